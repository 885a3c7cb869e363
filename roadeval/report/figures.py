"""The paper's figures 2, 3a and 3b as files, drawn by Matplotlib. No screen is needed.

Equal figures give equal files, byte for byte. Importing this takes a third of a second, so import
it only to draw.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.image import FigureImage
from matplotlib.ticker import MaxNLocator, StrMethodFormatter
from matplotlib.transforms import Bbox, TransformedBbox

from roadeval.data import BASELINE, FILTERED, IGNORE, UNFILTERED, Rgb, as_plain
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.tables import finals, values_of
from roadeval.report.chart import FAINT, thin
from roadeval.report.charts.standard import over_windows
from roadeval.report.images import ExampleFrame, encode_jpeg, pictures_of
from roadeval.report.pdf.typeset import typeset_figure
from roadeval.runtime.text import elide, visible
from roadeval.runtime.threads import map_ordered

if TYPE_CHECKING:
    import pandas as pd

DPI: Final = 200
WIDTH: Final = 8
"""Inches across a figure."""
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


def write_figures(
    folder: Path,
    drive: str,
    windows: pd.DataFrame,
    examples: Sequence[ExampleFrame],
    camera: str = "",
) -> list[Path]:
    """Write every figure that has something to draw as PNG and PDF; return the files.

    The folder is made if it is not there. ``windows`` are the rows of ``windows.csv``, of any
    number of variants, or no rows without truth; ``examples`` are a few frames, for figure 2;
    ``camera`` is the name of a camera of a rig, for titles and the files' names. An OSError if the
    folder cannot be written to; a `ReportError` if the system's folder for temporary files cannot
    be.
    """
    folder.mkdir(parents=True, exist_ok=True)
    drive = f"{drive}, {camera}" if camera else drive
    ending = f"-{as_plain(camera)}" if camera else ""

    def draw() -> Iterator[tuple[str, bytes]]:
        with mpl.rc_context(RC):  # type: ignore[arg-type]
            if examples:
                yield f"fig2_masks{ending}", as_svg(road_masks(drive, examples))
            if len(windows):
                yield f"fig3a_error_rate{ending}", as_svg(error_rate(drive, windows))
                yield f"fig3b_fp_fn_rate{ending}", as_svg(fp_fn_rate(drive, windows))

    def write(named_svg: tuple[str, bytes]) -> list[Path]:
        name, svg = named_svg
        files = {
            folder / f"{name}.png": typeset_figure(svg, "png", DPI),
            folder / f"{name}.pdf": typeset_figure(svg, "pdf"),
        }
        for path, content in files.items():
            path.write_bytes(content)
        return list(files)

    # Typst makes both files from one SVG in a few hundredths of a second, while the next figure is
    # drawn. Matplotlib would draw a figure once for each file, which takes ten times as long.
    return [path for paths in map_ordered(write, draw(), 1) for path in paths]


def as_svg(figure: Figure) -> bytes:
    """Return a figure as SVG."""
    content = BytesIO()
    figure.savefig(content, format="svg", dpi=DPI, metadata={"Date": None})
    return content.getvalue()


MARKED: Final = 25
"""Most markers along a line; a line with more points has markers at regular distances."""
CROWDED: Final = 150
"""More windows than this are drawn as means of neighbours."""
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
_LONGEST: Final = 80
"""Letters of a variant's name that fit in a line of the legend."""


def error_rate(drive: str, windows: pd.DataFrame) -> Figure:
    """Draw figure 3a of the paper: the error rate over the drive, in rows of ten frames."""
    return _over_drive(f"Error rate on {drive}", windows, {TESTED: "Error rate (ERR)"})


def fp_fn_rate(drive: str, windows: pd.DataFrame) -> Figure:
    """Draw figure 3b of the paper: both kinds of error over the drive, in rows of ten frames."""
    rates = {
        "FPR": "False positives (FPR)\nnon-road called road",
        "FNR": "False negatives (FNR)\nroad not found",
    }
    return _over_drive(f"False positive and false negative rate on {drive}", windows, rates)


def _over_drive(title: str, windows: pd.DataFrame, rates: Mapping[str, str]) -> Figure:
    """Draw the rates of every variant's final mask over the drive, one rate below the other."""
    charts = over_windows(windows, [*rates])
    figure = Figure(figsize=(WIDTH, 1.9 + 2 * len(charts)), layout="constrained")
    figure.suptitle(visible(title), x=0.012, ha="left", size=11, weight="bold", color=INK)
    axes = figure.subplots(len(charts), 1, sharex=True, squeeze=False)[:, 0]
    for ax, chart, label in zip(axes, charts, rates.values(), strict=True):
        ax.set_ylabel(label)
        for series in reversed(chart.series):
            thinned, look = thin(series, CROWDED), series.look
            ax.plot(
                thinned.x,
                thinned.y,
                color=look.colour,
                linestyle=_DASHES[look.dash],
                linewidth=1.8,
                marker=_MARKS[look.mark],
                markerfacecolor="white" if look.hollow else look.colour,
                markersize=5,
                markevery=-(-len(thinned.x) // MARKED),
                clip_on=False,
                label=series.name,
            )
        highest = max([y for series in chart.series for _, y in series.points()], default=None)
        if highest is None:
            ax.text(0.5, 0.5, "undefined on every frame", transform=ax.transAxes, ha="center")
        ax.set_ylim(0, max(1.08 * (highest or 0), 0.5))
        ax.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
        ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g} %"))
    axes[-1].xaxis.set_major_locator(MaxNLocator(nbins=10, integer=True))
    axes[-1].set_xlabel("frame")
    lines, variants = (entries[::-1] for entries in axes[0].get_legend_handles_labels())
    labels = [elide(_LABELS.get(variant, variant), _LONGEST) for variant in variants]
    columns = 100 // (max(map(len, labels)) + 10)
    axes[0].legend(
        lines,
        labels,
        title=_subtitle(windows),
        title_fontproperties={"size": 8.5},
        alignment="left",
        loc="lower left",
        bbox_to_anchor=(0, 1),
        borderaxespad=0.2,
        borderpad=0,
        ncols=min(max(columns, 1), 3),
        handlelength=3.4,
    ).get_title().set_color(FAINT)
    figure.align_ylabels(axes)
    return figure


def _subtitle(windows: pd.DataFrame) -> str:
    stages = ", ".join(values_of(finals(windows), "stage"))
    size, rows = windows["frames"].max(), -(-windows["window"].nunique() // CROWDED)
    point = f"{rows} rows of {size} frames" if rows > 1 else f"{size} frames"
    return f"Final mask ({stages}); each point is the mean of {point}; lower is better"


LEFT: Final = 0.28
TOP: Final = 0.78
"""Inches left of the pictures, for the frames' numbers, and above them, for the titles."""
GAP: Final = 0.05
"""Inches between pictures, and between a picture and its name."""


def road_masks(drive: str, examples: Sequence[ExampleFrame]) -> Figure:
    """Draw figure 2 of the paper: the image, and over it each variant's mask, and the truth."""
    rows = [*pictures_of([example.small() for example in examples])]
    height, width = rows[0]["camera image"].shape[:2]
    column_width = (WIDTH - LEFT) / len(rows[0])
    row_height = (column_width - GAP) * height / width + GAP
    figure_height = TOP + row_height * len(rows) + GAP
    figure = Figure(figsize=(WIDTH, figure_height))

    def write(x: float, y: float, text: str, **look: Any) -> None:
        figure.text(x / WIDTH, 1 - y / figure_height, text, **look)

    title = visible(f"Road masks on {drive}")
    write(0.1, 0.1, title, size=11, weight="bold", color=INK, va="top")
    write(0.1, 0.32, _legend(examples), size=8.5, color=FAINT, va="top")
    for row, (example, pictures) in enumerate(zip(examples, rows, strict=True)):
        top, bottom = TOP + row * row_height, TOP + (row + 1) * row_height - GAP
        name = f"frame {example.frame}" if row_height > 0.7 else str(example.frame)
        beside = {"rotation": 90, "ha": "right", "va": "center", "size": SMALL, "color": FAINT}
        write(LEFT - GAP, (top + bottom) / 2, name, **beside)
        for column, (title, picture) in enumerate(pictures.items()):
            left, right = LEFT + column * column_width, LEFT + (column + 1) * column_width - GAP
            low, high = 1 - bottom / figure_height, 1 - top / figure_height
            box = Bbox.from_extents(left / WIDTH, low, right / WIDTH, high)
            FigurePicture(figure, picture, box)
            if row == 0:
                name = elide(title, max(int(11 * column_width), 3))
                above = {"size": LETTERS, "color": INK, "ha": "center", "va": "bottom"}
                write((left + right) / 2, TOP - GAP, name, **above)
    return figure


def _legend(examples: Sequence[ExampleFrame]) -> str:
    truths = [example.truth for example in examples if example.truth is not None]
    ignored = any((truth == IGNORE).any() for truth in truths)
    variants = {variant for example in examples for variant in example.masks}
    missing = any(variants - example.masks.keys() for example in examples)
    return (
        "Green: road"
        + "; grey: ignored, counted nowhere" * ignored
        + "; faded: there is no mask of this frame" * missing
    )


class FigurePicture(FigureImage):
    """An ``(H, W, 3)`` uint8 RGB image that fills a box, given in shares of its figure.

    Matplotlib's own method takes some ten times as long: it resizes a picture with filters that
    make no visible difference here, and stores it in an SVG as PNG. Typst copies a JPEG into a PDF,
    but decodes a PNG and compresses it again.
    """

    def __init__(self, figure: Figure, image: Rgb, box: Bbox) -> None:
        super().__init__(figure)
        self._image = image
        self.box = TransformedBbox(box, figure.transFigure)
        self.set_data(image)
        figure.add_artist(self)

    def can_composite(self) -> bool:
        """Return False: Matplotlib must not merge the picture with its neighbours."""
        return False

    def draw(self, renderer: Any) -> None:
        """Draw the picture into an SVG, as JPEG."""
        jpeg = base64.b64encode(encode_jpeg(self._image, finest=True)).decode()
        renderer.writer.element(
            "image",
            x=f"{self.box.x0:.6g}",
            y=f"{renderer.height - self.box.y1:.6g}",
            width=f"{self.box.width:.6g}",
            height=f"{self.box.height:.6g}",
            preserveAspectRatio="none",
            attrib={"xlink:href": f"data:image/jpeg;base64,{jpeg}"},
        )
