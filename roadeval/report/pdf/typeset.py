"""Reports and figures typeset by Typst.

Typst is one wheel, Apache-2.0, that compiles offline in a few tens of milliseconds, breaks pages
and tables well, and brings its fonts. ReportLab leaves the layout to the caller, WeasyPrint needs
Pango and other system libraries, and no package of Python's index brings LaTeX. The document
travels as JSON with its pictures as files beside it, so no text of a log can become markup, and
nothing is fetched from anywhere.
"""

from __future__ import annotations

import json
import tempfile
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final, Literal

from roadeval.data import colours
from roadeval.errors import RoadevalError
from roadeval.runtime.files import put, writing

if TYPE_CHECKING:
    from roadeval.report.blocks import Report

_TEMPLATE: Final = "document.typ"


class ReportError(RoadevalError):
    """The document cannot be written."""


def typeset(
    document: Report, kind: Literal["pdf", "png"] = "pdf", pixels_per_inch: int | None = None
) -> bytes:
    """Return a report as a PDF, or a figure as a PDF or PNG; equal ones give equal bytes.

    Fonts are Typst's own, never the machine's, so that a document looks the same everywhere. A
    letter that none of them has is an empty box. A `ReportError` if the system's folder for
    temporary files cannot be written to.
    """
    import typst

    inks = {"accent": colours.hex_of(colours.BLUE), "alarm": colours.hex_of(colours.VERMILLION)}
    data = json.dumps(document.as_json() | {"colours": inks}).encode()
    template = files("roadeval.report.pdf").joinpath(_TEMPLATE).read_bytes()
    sources = {_TEMPLATE: template, "document.json": data, **document.files()}
    try:
        with TemporaryDirectory(prefix="roadeval-") as folder:
            for name, content in sources.items():
                Path(folder, name).write_bytes(content)
            compiled: bytes = typst.compile(
                Path(folder, _TEMPLATE),
                root=Path(folder),
                font_paths=typst.Fonts(include_system_fonts=False),
                format=kind,
                ppi=pixels_per_inch,
            )
    except OSError as error:
        raise ReportError(
            f"{tempfile.tempdir or 'no folder for temporary files'}: figures and reports are put "
            f"together there, and it cannot be written ({error.strerror}); make room, or name "
            "another folder with TMPDIR"
        ) from error
    return compiled


def write_file(path: Path, content: bytes) -> Path:
    """Write a report; an incomplete file never has its name.

    A `ReportError` if it cannot be written.
    """
    with writing(path, ReportError, "; choose another place"):
        put(path, content)
    return path
