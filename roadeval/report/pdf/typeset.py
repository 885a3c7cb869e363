"""From blocks to a PDF, by Typst.

Chosen over ReportLab (its own layout is left to the caller), WeasyPrint (needs Pango and other
system libraries) and LaTeX (no package of Python's index brings it): one wheel, Apache-2.0, that
compiles offline in a few tens of milliseconds, breaks pages and tables well, and brings its
fonts. The document travels as JSON and its pictures as files beside it, so no text of a log can
become markup, and nothing is fetched from anywhere.
"""

from __future__ import annotations

import json
import re
from enum import StrEnum
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from roadeval.errors import RoadevalError
from roadeval.report.blocks import Document
from roadeval.runtime.files import put as put_file

_TEMPLATE: Final = "document.typ"
_CONTROL: Final = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")


class Paper(StrEnum):
    """Sizes of paper."""

    A4 = "a4"
    LETTER = "letter"


_NAMES: Final = {Paper.A4: "a4", Paper.LETTER: "us-letter"}
"""Typst's names for them."""


class ReportError(RoadevalError):
    """The document cannot be written."""


def pdf(document: Document, paper: Paper = Paper.A4) -> bytes:
    """Typeset a document. The same document gives the same bytes.

    Fonts are Typst's own and, for the figures, Matplotlib's; never the machine's, so that it
    looks the same everywhere.
    """
    import typst

    data = _printable(document.plain() | {"paper": _NAMES[paper]})
    sources = {
        _TEMPLATE: files("roadeval.report.pdf").joinpath(_TEMPLATE).read_bytes(),
        "document.json": json.dumps(data).encode(),
        **document.files(),
    }
    with TemporaryDirectory(prefix="roadeval-") as folder:
        for name, content in sources.items():
            Path(folder, name).write_bytes(content)
        compiled: bytes = typst.compile(
            Path(folder, _TEMPLATE),
            root=Path(folder),
            format="pdf",
            font_paths=typst.Fonts(include_system_fonts=False, font_paths=[_figures_fonts()]),
        )
    return compiled


def put(path: Path, content: bytes) -> Path:
    """Write a file, which bears its name only when it is complete.

    Raises
    ------
    ReportError
        If it cannot be written.
    """
    try:
        put_file(path, content)
    except OSError as error:
        raise ReportError(
            f"{path}: cannot be written ({error.strerror}); choose another place with -o"
        ) from error
    return path


def _figures_fonts() -> str:
    """Find the folder of the fonts that Matplotlib brings."""
    from matplotlib import get_data_path

    return str(Path(get_data_path(), "fonts", "ttf"))


def _printable(value: Any) -> Any:
    """Leave out control characters and lone surrogates, which no font has."""
    match value:
        case str():
            return _CONTROL.sub("", value.encode("utf-8", "replace").decode())
        case dict():
            return {key: _printable(item) for key, item in value.items()}
        case list():
            return [_printable(item) for item in value]
        case _:
            return value
