"""The options that several commands share, each said once."""

from __future__ import annotations

import re
from collections.abc import Sequence
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, Final

import typer

from roadeval.errors import RoadevalError

option = partial(typer.Option, show_default=False)

_SELECTION: Final = re.compile(r"all|masks|none|(worst|every):[1-9]\d*")


class PresetName(StrEnum):
    """How the paper's equations are read."""

    PAPER = "paper"
    PRINTED = "printed"


def split_variant(text: str) -> tuple[str, Path]:
    """Read ``NAME=FILE.toml``."""
    name, _, file = text.partition("=")
    if not name or not file:
        raise typer.BadParameter(f"{text!r} is not NAME=FILE.toml")
    return name, Path(file)


# What can be seen to be wrong without opening a file is wrong usage, by the rooms' own rules.


def _plain_names(texts: list[str] | None) -> list[str]:
    from roadeval.config import check_variant_name
    from roadeval.data import FILTERED, UNFILTERED

    taken = {FILTERED, UNFILTERED}
    for name, _ in map(split_variant, texts or ()):
        try:
            check_variant_name(name, taken)
        except RoadevalError as error:
            raise typer.BadParameter(str(error)) from error
        taken.add(name)
    return texts or []


def _moment(text: str | None) -> str | None:
    from roadeval.logs import parse_time

    try:
        if text is not None:
            parse_time(text)
    except RoadevalError as error:
        raise typer.BadParameter(str(error)) from error
    return text


def _selection(text: str) -> str:
    if not _SELECTION.fullmatch(text):
        raise typer.BadParameter(f"{text!r} is none of all, masks, worst:K, every:N, none")
    return text
