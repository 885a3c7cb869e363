"""Reports and figures typeset by Typst.

Typst is one wheel, Apache-2.0, that compiles offline in a few tens of milliseconds, breaks pages
and tables well, and brings its fonts. ReportLab leaves the layout to the caller, WeasyPrint needs
Pango and other system libraries, and no package of Python's index brings LaTeX. Typst gets the
document as JSON with pictures as files beside it, so no text of a log can become markup, and
nothing is fetched from anywhere.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Mapping
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final, Literal

from roadeval.data import colours
from roadeval.errors import RoadevalError

if TYPE_CHECKING:
    from roadeval.report.blocks import Report

_MAIN: Final = "main.typ"
_FIGURE: Final = b"""
#set document(author: "roadeval", date: none)
#set page(width: auto, height: auto, margin: 0pt)
#image("figure.svg")
"""


def typeset(document: Report) -> bytes:
    """Return a report as a PDF; equal reports give equal bytes.

    A `RoadevalError` if the system's folder for temporary files cannot be written to.
    """
    inks = {"accent": colours.hex_of(colours.BLUE), "alarm": colours.hex_of(colours.VERMILLION)}
    data = json.dumps(document.as_json() | {"colours": inks}).encode()
    template = files("roadeval.report.pdf").joinpath("document.typ").read_bytes()
    return _compile({_MAIN: template, "document.json": data, **document.files()})


def typeset_figure(
    svg: bytes, kind: Literal["pdf", "png"], pixels_per_inch: int | None = None
) -> bytes:
    """Return a figure as a PNG, or as a PDF of one page that has the figure's size.

    A `RoadevalError` if the system's folder for temporary files cannot be written to.
    """
    return _compile({_MAIN: _FIGURE, "figure.svg": svg}, kind, pixels_per_inch)


def _compile(
    sources: Mapping[str, bytes],
    kind: Literal["pdf", "png"] = "pdf",
    pixels_per_inch: int | None = None,
) -> bytes:
    """Compile files, one of them the main file, to a PDF or PNG.

    Fonts are Typst's own and, for figures and charts, Matplotlib's DejaVu Sans, but never the
    machine's, so a document looks the same everywhere. A letter that no font has is an empty box.
    Only DejaVu Sans is copied from Matplotlib's folder, because another font there has a
    placeholder for every letter: Typst would set a whole text of a figure in that font if DejaVu
    Sans lacks one letter of the text.
    """
    import typst

    # To import Matplotlib takes longer than to make a whole report.
    matplotlib = find_spec("matplotlib")
    assert matplotlib is not None
    assert matplotlib.origin is not None
    fonts = Path(matplotlib.origin).parent / "mpl-data/fonts/ttf"
    try:
        with TemporaryDirectory(prefix="roadeval-") as folder:
            for name, content in sources.items():
                Path(folder, name).write_bytes(content)
            for font in fonts.glob("DejaVuSans*.ttf"):
                shutil.copy(font, folder)
            compiled: bytes = typst.compile(
                Path(folder, _MAIN),
                root=Path(folder),
                font_paths=typst.Fonts(include_system_fonts=False, font_paths=[folder]),
                format=kind,
                ppi=pixels_per_inch,
            )
    except OSError as error:
        raise RoadevalError(
            f"{tempfile.tempdir or 'no folder for temporary files'}: figures and reports are made "
            f"there, and it cannot be written ({error.strerror}); make room, or name "
            "another folder with TMPDIR"
        ) from error
    return compiled
