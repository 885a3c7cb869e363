"""Blocks typeset as a PDF by Typst.

Chosen over ReportLab (its own layout is left to the caller), WeasyPrint (needs Pango and other
system libraries) and LaTeX (no package of Python's index brings it): one wheel, Apache-2.0, that
compiles offline in a few tens of milliseconds, breaks pages and tables well, and brings its
fonts. The document travels as JSON and its pictures as files beside it, so no text of a log can
become markup, and nothing is fetched from anywhere.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Sequence
from enum import StrEnum
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, Literal

from roadeval.data import colours
from roadeval.errors import RoadevalError
from roadeval.runtime.files import put
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    from roadeval.report.blocks import Document

Kind = Literal["pdf", "png"]
_TEMPLATE: Final = "document.typ"
_FIGURE: Final = "figure"
"""The template's name of a page as high as what is on it."""


class Paper(StrEnum):
    """Paper sizes."""

    A4 = "a4"
    LETTER = "letter"


_TYPST_NAMES: Final = {Paper.A4: "a4", Paper.LETTER: "us-letter"}


class ReportError(RoadevalError):
    """The document cannot be written."""


def pdf(document: Document, paper: Paper = Paper.A4) -> bytes:
    """Return a document as PDF; equal documents give equal bytes.

    Fonts are Typst's own, never the machine's, so that a document looks the same everywhere. A
    letter that none of them has is an empty box.
    """
    (made,) = _compiled(document, _TYPST_NAMES[paper], ["pdf"])
    return made


def figure_files(document: Document, dots_per_inch: int) -> dict[Kind, bytes]:
    """Return the blocks of a document on one page of their height, as ``png`` and as ``pdf``."""
    kinds: list[Kind] = ["png", "pdf"]
    return dict(zip(kinds, _compiled(document, _FIGURE, kinds, dots_per_inch), strict=True))


def write_file(path: Path, content: bytes) -> Path:
    """Write a report; an incomplete file never has its name.

    Raises
    ------
    ReportError
        If it cannot be written.
    """
    try:
        put(path, content)
    except OSError as error:
        raise ReportError(
            f"{path}: cannot be written ({error.strerror}); choose another place"
        ) from error
    return path


def _compiled(
    document: Document, paper: str, kinds: Sequence[Kind], dots_per_inch: int | None = None
) -> list[bytes]:
    """Return what Typst makes of a document, in each format.

    Raises
    ------
    ReportError
        If its files cannot be written into the system's folder for temporary ones.
    """
    import typst

    inks = {"accent": colours.hex_of(colours.BLUE), "alarm": colours.hex_of(colours.VERMILLION)}
    data = _visible(document.as_json() | {"paper": paper, "colours": inks})
    template = files("roadeval.report.pdf").joinpath(_TEMPLATE).read_bytes()
    try:
        with TemporaryDirectory(prefix="roadeval-") as folder:
            for name, content in (
                (_TEMPLATE, template),
                ("document.json", json.dumps(data).encode()),
                *document.files().items(),
            ):
                Path(folder, name).write_bytes(content)
            source, fonts = Path(folder, _TEMPLATE), typst.Fonts(include_system_fonts=False)
            return [
                typst.compile(
                    source, root=source.parent, font_paths=fonts, format=kind, ppi=dots_per_inch
                )
                for kind in kinds
            ]
    except OSError as error:
        raise ReportError(
            f"{tempfile.tempdir or 'no folder for temporary files'}: figures and reports are put "
            f"together there, and it cannot be written ({error.strerror}); make room, or name "
            "another folder with TMPDIR"
        ) from error


def _visible(value: Any) -> Any:
    """Return a value with every text in it as `roadeval.runtime.text.visible` returns it."""
    match value:
        case str():
            return visible(value)
        case dict():
            return {key: _visible(item) for key, item in value.items()}
        case list():
            return [_visible(item) for item in value]
        case _:
            return value
