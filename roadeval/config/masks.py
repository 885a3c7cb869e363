"""Masks of other methods that lie beside the log: the tables ``[masks.NAME]``."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from roadeval.config.errors import ConfigError
from roadeval.config.override import override
from roadeval.logs.settings import MaskSettings

DRIVE: Final = "{drive}"
"""Stands in a path for the name of the drive."""

Masks = Mapping[str, MaskSettings]
"""Settings by the variant's name."""


def with_masks(current: Masks, tables: Any, where: str) -> Masks:
    """Return settings with those of further tables: key by key where the name is there.

    Raises
    ------
    ConfigError
        For a key or a value that cannot be used.
    """
    if not isinstance(tables, Mapping):
        begin = f"{where}: " if where else ""
        raise ConfigError(f"{begin}[masks] must hold a table for each variant")
    found = dict(current)
    for name, own in tables.items():
        table = f"masks.{name}"
        found[name] = override(found.get(name, MaskSettings()), {table: own}, table, where)
    return found


def of_drive(masks: Masks, drive: str | os.PathLike[str]) -> Masks:
    """Return settings with the drive's name in their paths: its file's, without the ending.

    A `ConfigError` if some have no path.
    """
    path = Path(drive)
    name = path.name if path.is_dir() else path.stem
    for own, each in masks.items():
        if not each.path:
            raise ConfigError(f"[masks.{own}] has no path: a folder, or LOG.mcap:/topic")
    return {
        own: replace(
            each,
            path=each.path.replace(DRIVE, name),
            images=each.images and each.images.replace(DRIVE, name),
        )
        for own, each in masks.items()
    }
