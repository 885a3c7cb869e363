"""Figures as files: PNG, PDF and SVG. No screen is needed.

Equal figures give equal files, byte for byte.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Final

from roadeval.report.blocks import ImageFile
from roadeval.report.figures.figure import FigureData, FigureSpec, figures
from roadeval.report.figures.style import RC
from roadeval.report.pdf.typeset import page_of, picture_of
from roadeval.runtime.threads import ordered

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DPI: Final = 200
_HEADER: Final = 33
"""Bytes of a PNG's signature and first chunk."""


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
    ReportError
        If the system's folder for temporary files cannot be.
    """
    folder.mkdir(parents=True, exist_ok=True)
    # Typst, which sets the reports too, makes both files of one SVG in a few hundredths of a second
    # and beside the drawing of the next figure; Matplotlib's own ways draw a figure once for each,
    # and take ten times as long.
    drawn = ((spec.name, image.content) for spec in figures() if (image := svg_of(spec, data)))
    return [path for files in ordered(partial(_write, folder), drawn, 1) for path in files]


def svg(draw: Callable[[], Figure]) -> ImageFile:
    """Return a figure as SVG.

    Text stays text, in the font that `roadeval.report.pdf.typeset` finds with Matplotlib, so that
    the document embeds each font once and its figures can be searched.
    """
    with _style():
        return ImageFile(_svg(draw()))


def svg_of(spec: FigureSpec, data: FigureData) -> ImageFile | None:
    """Return a figure of the results folder as SVG; None if there is nothing to draw."""
    with _style():
        figure = spec.draw(data)
        return None if figure is None else ImageFile(_svg(figure))


def _write(folder: Path, figure: tuple[str, bytes]) -> list[Path]:
    """Write a figure's files, given its name and its SVG."""
    name, svg = figure
    files = {
        folder / f"{name}.png": _with_dpi(picture_of(svg, _DPI)),
        folder / f"{name}.pdf": page_of(svg),
    }
    for path, content in files.items():
        path.write_bytes(content)
    return list(files)


@contextmanager
def _style() -> Iterator[None]:
    import matplotlib as mpl

    with mpl.rc_context(RC):  # type: ignore[arg-type]
        yield


def _with_dpi(png: bytes) -> bytes:
    """Return a PNG file that says how large its dots are, right after its header."""
    dots = round(_DPI / 0.0254)
    chunk = b"pHYs" + struct.pack(">IIB", dots, dots, 1)
    sized = struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
    return png[:_HEADER] + sized + png[_HEADER:]


def _svg(figure: Figure) -> bytes:
    """Return a figure as SVG."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    if engine := figure.get_layout_engine():
        # As `savefig` would, but without drawing everything once more for it. An SVG's canvas
        # measures letters in its own way.
        FigureCanvasSVG(figure)
        engine.execute(figure)
        figure.set_layout_engine("none")
    content = BytesIO()
    figure.savefig(content, format="svg", dpi=_DPI, metadata={"Date": None})
    return content.getvalue()
