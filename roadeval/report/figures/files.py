"""Figures as files: PNG, PDF and SVG. No screen is needed.

Equal figures give equal files, byte for byte.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.report.blocks import ImageFile
from roadeval.report.figures.figure import FigureData, FigureSpec, figures
from roadeval.report.figures.style import RC
from roadeval.report.pdf.typeset import page_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SAVING: Final[Mapping[str, Mapping[str, Any]]] = {
    # This packs twice as fast as Pillow's own choice, into files 4 % larger.
    "png": {"metadata": {"Software": None}, "pil_kwargs": {"compress_level": 4}},
    "svg": {"metadata": {"Date": None}},
}
_DPI: Final = 200


def write_figures(folder: Path, data: FigureData) -> list[Path]:
    """Write every figure that has something to draw as PNG and PDF.

    Parameters
    ----------
    folder
        Made if it does not exist.
    data
        What is drawn.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    return [path for figure in figures() for path in _write(folder, figure, data)]


def svg(draw: Callable[[], Figure]) -> ImageFile:
    """Return a figure as SVG.

    Text stays text, in the font that `roadeval.report.pdf.typeset` finds with Matplotlib, so that
    the document embeds each font once and its figures can be searched.
    """
    with _style():
        return ImageFile(_encoded(draw(), "svg"))


def svg_of(spec: FigureSpec, data: FigureData) -> ImageFile | None:
    """Return a figure of the results folder as SVG; None if there is nothing to draw."""
    with _style():
        figure = spec.draw(data)
        return None if figure is None else ImageFile(_encoded(figure, "svg"))


def _write(folder: Path, spec: FigureSpec, data: FigureData) -> Iterator[Path]:
    with _style():
        figure = spec.draw(data)
        if figure is None:
            return
        # Typst, which sets the reports too, makes a PDF of an SVG in a few milliseconds;
        # Matplotlib's own way takes a few tenths of a second, most of it for the fonts.
        files = {"png": _encoded(figure, "png"), "pdf": page_of(_encoded(figure, "svg"))}
    for kind, content in files.items():
        path = folder / f"{spec.name}.{kind}"
        path.write_bytes(content)
        yield path


@contextmanager
def _style() -> Iterator[None]:
    import matplotlib as mpl

    with mpl.rc_context(RC):  # type: ignore[arg-type]
        yield


def _encoded(figure: Figure, kind: str) -> bytes:
    content = BytesIO()
    figure.savefig(content, format=kind, dpi=_DPI, **_SAVING[kind])
    return content.getvalue()
