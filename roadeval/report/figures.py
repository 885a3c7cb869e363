"""The paper's figures 2, 3a and 3b as files, drawn by Matplotlib. No screen is needed.

Equal figures give equal files, byte for byte. Importing this takes a third of a second: whoever
draws does it then.
"""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import cv2
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.image import FigureImage
from matplotlib.textpath import text_to_path
from matplotlib.ticker import MaxNLocator, StrMethodFormatter
from matplotlib.transforms import Bbox, TransformedBbox

from roadeval.data import (
    BASELINE,
    FILTERED,
    IGNORE,
    ROAD,
    UNFILTERED,
    Mask,
    Rgb,
    Rows,
    Truth,
    colours,
)
from roadeval.data.rows import Cells
from roadeval.evaluation import scored
from roadeval.report.chart import FAINT, looks
from roadeval.report.images import (
    EXAMPLE_WIDTH,
    ExampleFrame,
    faded,
    finest_jpeg,
    shrink,
    variants_of,
)
from roadeval.report.pdf.typeset import page_of, picture_of
from roadeval.runtime.text import elided, visible
from roadeval.runtime.threads import ordered

DPI: Final = 200
WIDTH: Final = 8
"""Inches across a figure."""
INCH: Final = 72
"""Points in an inch."""
LETTERS: Final = 9
SMALL: Final = 8
"""Points of labels and legends, and of the ticks' labels."""
INK: Final = "#222222"
RC: Final[dict[str, Any]] = {
    "font.family": "DejaVu Sans",
    "font.size": LETTERS,
    "axes.labelsize": LETTERS,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": "#333333",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "xtick.color": "#333333",
    "ytick.color": "#333333",
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "legend.frameon": False,
    "legend.fontsize": LETTERS,
    "svg.fonttype": "none",
    "svg.hashsalt": "roadeval",
    "text.parse_math": False,  # a dollar in a name is no formula
    "savefig.facecolor": "white",
}
"""Matplotlib's settings for every figure; in an SVG, and so in a PDF, text stays text."""
_PNG_HEADER: Final = 33
"""Bytes of a PNG's signature and first chunk."""


@dataclass(frozen=True, slots=True, eq=False)
class FigureData:
    """The results that figures are drawn from."""

    drive: str
    """Its name, for titles."""
    windows: Rows
    """As ``windows.csv``, any number of variants; no row without truth."""
    examples: Sequence[ExampleFrame] = ()
    """A few frames."""


def write_figures(folder: Path, data: FigureData) -> list[Path]:
    """Write every figure that has something to draw as PNG and PDF; return the files.

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
    return [path for files in ordered(partial(_write, folder), _drawn(data), 1) for path in files]


def _drawn(data: FigureData) -> Iterator[tuple[str, bytes]]:
    """Yield each figure's name and its SVG."""
    with mpl.rc_context(RC):  # type: ignore[arg-type]
        for name, draw in FIGURES.items():
            if figure := draw(data):
                yield name, svg(figure)


def _write(folder: Path, figure: tuple[str, bytes]) -> list[Path]:
    name, drawing = figure
    files = {
        folder / f"{name}.png": _with_dpi(picture_of(drawing, DPI)),
        folder / f"{name}.pdf": page_of(drawing),
    }
    for path, content in files.items():
        path.write_bytes(content)
    return list(files)


def _with_dpi(png: bytes) -> bytes:
    """Return a PNG file that says how large its dots are, right after its header."""
    dots = round(DPI / 0.0254)
    chunk = b"pHYs" + struct.pack(">IIB", dots, dots, 1)
    sized = struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
    return png[:_PNG_HEADER] + sized + png[_PNG_HEADER:]


def svg(figure: Figure) -> bytes:
    """Return a figure as SVG."""
    if engine := figure.get_layout_engine():
        # As `savefig` would, but without drawing everything once more for it. An SVG's canvas
        # measures letters in its own way.
        FigureCanvasSVG(figure)
        engine.execute(figure)
        figure.set_layout_engine("none")
    content = BytesIO()
    figure.savefig(content, format="svg", dpi=DPI, metadata={"Date": None})
    return content.getvalue()


def _fitting(name: str, room: float) -> str:
    """Return a name in as many letters as fit into so many points; three at least."""
    letters = len(visible(name))
    while letters > 3 and _width(elided(name, letters)) > room:
        letters -= 1
    return elided(name, letters)


def _width(text: str) -> float:
    """Return the width of a line of text in points."""
    font = FontProperties(family=RC["font.family"], size=LETTERS)
    width: float = text_to_path.get_text_width_height_descent(text, font, ismath=False)[0]
    return width


# --- Figures 3a and 3b ----------------------------------------------------------------------------

CROWDED: Final = 150
"""More windows than this are drawn as means of several, with their range as a band."""
MARKED: Final = 25
"""Up to this many points each has its marker; beyond, about as many do."""
PALE: Final = 0.4
"""Opacity of a last row that holds fewer frames than the others, and of the line to it."""
_LABELS: Final = {
    FILTERED: "filtered: with the shadow filter",
    UNFILTERED: "unfiltered: without it",
    BASELINE: "blind: never looks at the image",
}
_DASHES: Final = {
    "solid": "-",
    "dashed": (0, (5, 2)),
    "dotted": (0, (1, 1.4)),
    "dash-dotted": (0, (7, 2, 1.5, 2)),
}
_MARKS: Final = {"circle": "o", "square": "s", "triangle": "^", "diamond": "D", "cross": "x"}
_ROOM: Final = INCH * (WIDTH - 1)
_HANDLE: Final = 4.2 * LETTERS
_BETWEEN: Final = 2 * LETTERS
"""Points that a legend has, that a line before a label takes, and that lie between columns."""


def error_rate(data: FigureData) -> Figure | None:
    """Draw figure 3a of the paper: the error rate over the drive, in rows of ten frames."""
    return _over_drive(f"Error rate on {data.drive}", data, {"ERR": "Error rate (ERR)"}, 3.9)


def fp_fn_rate(data: FigureData) -> Figure | None:
    """Draw figure 3b of the paper: both kinds of error over the drive, in rows of ten frames."""
    rates = {
        "FPR": "False positives (FPR)\nnon-road called road",
        "FNR": "False negatives (FNR)\nroad not found",
    }
    title = f"False positive and false negative rate on {data.drive}"
    return _over_drive(title, data, rates, 5.9)


def _over_drive(
    title: str, data: FigureData, rates: Mapping[str, str], height: float
) -> Figure | None:
    """Draw rates of each variant's final mask, each with its label, one below the other."""
    if not len(data.windows):
        return None
    final = scored.finals(data.windows)
    rows = scored.each_window(final)
    group = -(-len(rows) // CROWDED)
    size, rest = rows["frames"].max(), rows["frames"][-1]
    last, short = rows["window"][-1], ""
    if rest < size and group > 1:
        final, rows = final.take(final["window"] < last), rows.take(slice(-1))
        short = f"; a last row of {rest} is left out"
    elif rest < size:
        short = f"; the last row, drawn pale, holds {rest}"
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    figure.suptitle(visible(title), x=0.012, ha="left", size=11, weight="bold", color=INK)
    axes = figure.subplots(len(rates), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (rate, label) in zip(axes, rates.items(), strict=True):
        _draw(ax, final, rate, group, pale=last if short else None)
        ax.set_ylabel(label)
    _label_rows(axes[-1], rows, short)
    handles, names = axes[0].get_legend_handles_labels()
    names = [_fitting(name, _ROOM - _HANDLE) for name in names]
    columns = int((_ROOM + _BETWEEN) / (max(map(_width, names)) + _HANDLE + _BETWEEN))
    axes[0].legend(
        handles,
        names,
        title=_subtitle(final, rows, group),
        title_fontproperties={"size": 8.5},
        alignment="left",
        loc="lower left",
        bbox_to_anchor=(0, 1),
        borderaxespad=0.2,
        borderpad=0,
        ncols=min(columns, 3),
        handlelength=3.4,
    ).get_title().set_color(FAINT)
    figure.align_ylabels(axes)
    return figure


def _subtitle(final: Rows, rows: Rows, group: int) -> str:
    stages, size = ", ".join(final.distinct("stage")), rows["frames"].max()
    each = f"each point is the mean of {size} frames" if size > 1 else "each point is one frame"
    if group > 1:
        each = f"each point averages {group} rows of {size} frames, the band spans them"
    return f"Final mask ({stages}); {each}; lower is better"


def _draw(ax: Axes, final: Rows, rate: str, group: int, pale: int | None) -> None:
    """Draw each variant's series; with too many rows to tell apart, their mean and range.

    ``pale`` is the number of a last row that does not count as much as the others.
    """
    for name, look in looks(final.distinct("variant")).items():
        own = final.of_variant(name)
        own = own.take(np.argsort(own["window"], kind="stable"))
        x, y = own["window"], 100 * own[rate]
        if group > 1:
            starts = np.arange(0, len(x), group)
            low, high = np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)
            x, y = _means(x, starts), _means(y, starts)
            ax.fill_between(x, low, high, color=look.colour, alpha=0.15, linewidth=0)
        drawn: dict[str, Any] = {
            "color": look.colour,
            "linestyle": _DASHES[look.dash],
            "linewidth": 1.8,
            "marker": _MARKS[look.mark],
            "markerfacecolor": "white" if look.hollow else look.colour,
            "markersize": 5,
            "clip_on": False,
        }
        order = 2 if name == BASELINE else 3
        if len(x) > 1 and x[-1] == pale:
            ax.plot(x[-2:], y[-2:], **drawn, alpha=PALE, markevery=[1], zorder=order - 1)
            x, y = x[:-1], y[:-1]
        every = -(-len(x) // MARKED)
        ax.plot(x, y, **drawn, label=_LABELS.get(name, name), markevery=every, zorder=order)
    values = 100 * final[rate]
    if np.isnan(values).all():
        ax.text(0.5, 0.5, "undefined on every frame", transform=ax.transAxes, ha="center")
    ax.set_ylim(0, max(1.08 * np.nanmax([*values, 0.1]), 0.5))
    ax.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
    ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g} %"))


def _means(values: Cells, starts: Cells) -> Cells:
    """Return the mean of each run of values that are known; NaN where none is."""
    known = ~np.isnan(values)
    sums = np.add.reduceat(np.where(known, values, 0.0), starts)
    counts = np.add.reduceat(known.astype(int), starts)
    means: Cells = np.full(len(starts), np.nan)
    return np.divide(sums, counts, out=means, where=counts > 0)


def _label_rows(ax: Axes, rows: Rows, short: str) -> None:
    """Write each row's frames below it; where there is no room, the first frame of some.

    ``short`` says what became of a last row of fewer frames.
    """
    ends = [*zip(rows["first_frame"].tolist(), rows["last_frame"].tolist(), strict=True)]
    first = [str(begin) for begin, _ in ends]
    spans = [str(a) if a == b else f"{a}\N{EN DASH}{b}" for a, b in ends]
    roomy = _step(spans) == 1
    labels = spans if roomy else first
    every = _step(labels)
    numbers = rows["window"]
    ax.set_xticks(numbers[::every], labels[::every])
    margin = 0.5 if len(rows) < CROWDED else 0.005 * len(rows)
    ax.set_xlim(numbers[0] - margin, numbers[-1] + margin)
    size = rows["frames"].max()
    what = f"Evaluated frames, {size} a row" if roomy else f"First frame of each row of {size}"
    ax.set_xlabel(what + short)


def _step(labels: Sequence[str]) -> int:
    """Return n such that every nth label fits on 7 inches of axis at 8 points."""
    room = max(int(7 / (0.075 * max(map(len, labels)) + 0.12)), 1)
    return -(-len(labels) // room)


# --- Figure 2 -------------------------------------------------------------------------------------

LEFT: Final = 0.28
TOP: Final = 0.78
"""Inches left of and above the pictures, for the frames' numbers and the titles."""
GAP: Final = 0.05
"""Inches between pictures, and to what names them."""


def road_masks(data: FigureData) -> Figure | None:
    """Draw figure 2 of the paper: the image, each variant's mask over it, and the truth over it."""
    if not data.examples:
        return None
    truth = any(example.truth is not None for example in data.examples)
    names = variants_of(data.examples)
    rows = [_pictures(example, names, truth=truth) for example in data.examples]
    height, width = rows[0]["camera image"].shape[:2]
    across = (WIDTH - LEFT) / len(rows[0])
    down = (across - GAP) * height / width + GAP
    total = TOP + down * len(rows) + GAP
    figure = Figure(figsize=(WIDTH, total))

    def write(x: float, y: float, text: str, **look: Any) -> None:
        figure.text(x / WIDTH, 1 - y / total, text, **look)

    title = visible(f"Road masks on {data.drive}")
    write(0.1, 0.1, title, size=11, weight="bold", color=INK, va="top")
    write(0.1, 0.32, _legend(data.examples, names), size=8.5, color=FAINT, va="top")
    for number, (example, pictures) in enumerate(zip(data.examples, rows, strict=True)):
        top, bottom = TOP + number * down, TOP + (number + 1) * down - GAP
        name = f"frame {example.frame}"
        shown = name if _width(name) < INCH * (down - GAP) else str(example.frame)
        beside = {"rotation": 90, "ha": "right", "va": "center", "size": SMALL, "color": FAINT}
        write(LEFT - GAP, (top + bottom) / 2, shown, **beside)
        for column, (title, picture) in enumerate(pictures.items()):
            left, right = LEFT + column * across, LEFT + (column + 1) * across - GAP
            sides = left / WIDTH, 1 - bottom / total, right / WIDTH, 1 - top / total
            Picture(figure, picture, Bbox.from_extents(*sides))
            if number == 0:
                name = _fitting(title, INCH * (across - GAP))
                above = {"size": LETTERS, "color": INK, "ha": "center", "va": "bottom"}
                write((left + right) / 2, TOP - GAP, name, **above)
    return figure


FIGURES: Final = {
    "fig2_masks": road_masks,
    "fig3a_error_rate": error_rate,
    "fig3b_fp_fn_rate": fp_fn_rate,
}


def _pictures(example: ExampleFrame, variants: Sequence[str], *, truth: bool) -> dict[str, Rgb]:
    """Return an example's pictures by their columns' titles."""
    image = shrink(example.image, EXAMPLE_WIDTH)
    pictures = {"camera image": image}
    for name in variants:
        mask = example.masks.get(name)
        pictures[name] = faded(image) if mask is None else _overlay(image, mask)
    return pictures | ({"ground truth": _overlay(image, example.truth)} if truth else {})


def _legend(examples: Sequence[ExampleFrame], names: Sequence[str]) -> str:
    ignored = any(e.truth is not None and (e.truth == IGNORE).any() for e in examples)
    missing = any(len(e.masks) < len(names) for e in examples)
    return (
        "Green with a white edge: road"
        + "; grey: ignored, counted nowhere" * ignored
        + "; faded: there is no mask of this frame" * missing
    )


def _overlay(image: Rgb, labels: Mask | Truth | None) -> Rgb:
    """Draw a mask or a truth over the image: road tinted, with a white edge; ignored pixels grey.

    The edge tells the road apart in a black and white print, too.
    """
    if labels is None:
        return image
    small = shrink(labels, EXAMPLE_WIDTH, labels=True)
    picture = image.astype(np.float32)
    for value, colour, strength in ((ROAD, colours.ROAD, 0.45), (IGNORE, colours.IGNORE, 0.8)):
        here = small == value
        picture[here] += strength * (np.array(colour, np.float32) - picture[here])
    road = (small == ROAD).view(np.uint8)
    picture[cv2.erode(road, np.ones((3, 3), np.uint8)) != road] = 255
    return np.rint(picture).astype(np.uint8)


class Picture(FigureImage):
    """An ``(H, W, 3)`` uint8 RGB image that fills a box, given in shares of its figure.

    Matplotlib's own way takes some ten times as long: it brings a picture to size by filters that
    show no difference here, and packs it into an SVG as PNG. Typst takes a JPEG into a PDF as it
    is, and would unpack a PNG and pack it again.
    """

    def __init__(self, figure: Figure, image: Rgb, box: Bbox) -> None:
        super().__init__(figure)
        self._image = image
        self.box = TransformedBbox(box, figure.transFigure)
        self.set_data(image)
        figure.add_artist(self)

    def can_composite(self) -> bool:
        """Return False: it stays a picture of its own, and is not made one with those beside it."""
        return False

    def draw(self, renderer: Any) -> None:
        """Draw it into an SVG, as JPEG."""
        content = base64.b64encode(finest_jpeg(self._image)).decode()
        renderer.writer.element(
            "image",
            x=f"{self.box.x0:.6g}",
            y=f"{renderer.height - self.box.y1:.6g}",
            width=f"{self.box.width:.6g}",
            height=f"{self.box.height:.6g}",
            preserveAspectRatio="none",
            attrib={"xlink:href": f"data:image/jpeg;base64,{content}"},
        )
