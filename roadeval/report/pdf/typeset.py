"""Blocks typeset as a PDF by Typst.

Chosen over ReportLab (its own layout is left to the caller), WeasyPrint (needs Pango and other
system libraries) and LaTeX (no package of Python's index brings it): one wheel, Apache-2.0, that
compiles offline in a few tens of milliseconds, breaks pages and tables well, and brings its
fonts. The document travels as JSON and its pictures as files beside it, so no text of a log can
become markup, and nothing is fetched from anywhere.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache, partial
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, Literal

from roadeval.data import colours
from roadeval.errors import RoadevalError
from roadeval.runtime.files import put, writing
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    from roadeval.report.blocks import Document

_TEMPLATE: Final = "document.typ"
_FIGURE: Final = b"""
#set document(author: "roadeval", date: none)
#set page(width: auto, height: auto, margin: 0pt)
#image("figure.svg")
"""


class ReportError(RoadevalError):
    """The document cannot be written."""


def pdf(document: Document) -> bytes:
    """Return a document as PDF; equal documents give equal bytes.

    Fonts are Typst's own and, for the figures, DejaVu Sans; never the machine's, so that a document
    looks the same everywhere. A letter that none of them has is an empty box.
    """
    inks = {"accent": colours.hex_of(colours.BLUE), "alarm": colours.hex_of(colours.VERMILLION)}
    data = _visible(document.as_json() | {"colours": inks})
    template = files("roadeval.report.pdf").joinpath(_TEMPLATE).read_bytes()
    return _compiled(template, {"document.json": json.dumps(data).encode(), **document.files()})


def figure_as(kind: Literal["pdf", "png"], svg: bytes, dots_per_inch: int | None = None) -> bytes:
    """Return a figure, given as SVG, as a PDF of one page of its size, or as a PNG."""
    return _compiled(_FIGURE, {"figure.svg": svg}, kind, dots_per_inch)


def write_file(path: Path, content: bytes) -> Path:
    """Write a report; an incomplete file never has its name.

    A `ReportError` if it cannot be written.
    """
    with writing(path, partial(ReportError, remedy="choose another place")):
        put(path, content)
    return path


def _compiled(
    template: bytes,
    sources: Mapping[str, bytes],
    kind: Literal["pdf", "png"] = "pdf",
    dots_per_inch: int | None = None,
) -> bytes:
    """Return what Typst makes of a template and the files that it reads, as a PDF or PNG.

    A `ReportError` if these files cannot be written into the system's folder for temporary ones.
    """
    import typst

    with _explained(), TemporaryDirectory(prefix="roadeval-") as folder:
        for name, content in {_TEMPLATE: template, **sources}.items():
            Path(folder, name).write_bytes(content)
        compiled: bytes = typst.compile(
            Path(folder, _TEMPLATE),
            root=Path(folder),
            font_paths=_fonts()[0],
            format=kind,
            ppi=dots_per_inch,
        )
    return compiled


@contextmanager
def _explained() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise ReportError(
            f"{tempfile.tempdir or 'no folder for temporary files'}: figures and reports are put "
            f"together there, and it cannot be written ({error.strerror}); make room, or name "
            "another folder with TMPDIR"
        ) from error


@cache
def _fonts() -> tuple[Any, TemporaryDirectory[str]]:
    """Return Typst's own fonts and Matplotlib's DejaVu Sans, and a folder of that one alone.

    Typst reads the folder as long as the process lives. Matplotlib's own folder also has a font
    with a sign for every letter there is: a text of a figure is set in one font, and if it had but
    one letter that DejaVu Sans lacks, as in a drive's name, all of it would be such signs.
    """
    import typst

    # Found without the import, which takes longer than a whole report.
    found = find_spec("matplotlib")
    assert found is not None
    assert found.origin is not None
    folder = TemporaryDirectory(prefix="roadeval-")
    for font in Path(found.origin).parent.glob("mpl-data/fonts/ttf/DejaVuSans*.ttf"):
        try:
            Path(folder.name, font.name).symlink_to(font)
        except OSError:  # a system on which not everyone may link
            shutil.copy(font, folder.name)
    return typst.Fonts(include_system_fonts=False, font_paths=[folder.name]), folder


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
