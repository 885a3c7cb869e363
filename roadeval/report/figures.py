"""The paper's figures 2, 3a and 3b as files, drawn by Matplotlib. No screen is needed.

Equal figures give equal files, byte for byte. Importing this takes a third of a second, so import
it only to draw.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any, Final, Literal

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.image import FigureImage
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, StrMethodFormatter
from matplotlib.transforms import Bbox, TransformedBbox

from roadeval.data import BASELINE, FILTERED, IGNORE, UNFILTERED, Rgb, as_plain
from roadeval.data.words import counted
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.tables import finals, values_of
from roadeval.report.chart import FAINT, thin
from roadeval.report.charts.standard import describe_points, over_windows, short_end
from roadeval.report.images import ExampleFrame, encode_jpeg, pictures_of
from roadeval.report.pdf.typeset import typeset_figure
from roadeval.report.writing import write_file
from roadeval.runtime.text import elide, visible
from roadeval.runtime.threads import map_ordered

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from roadeval.report.chart import Chart

DPI: Final = 200
WIDTH: Final = 8
"""Inches across a figure."""
EDGE: Final = 0.1
AXIS: Final = 0.85
FOOT: Final = 0.45
GAP_OF_AXES: Final = 0.15
"""Inches at a figure's edges, to the left of its axes, below its axes, and between two axes."""
NARROW: Final = 5
"""Inches across a figure below which its letters are smaller."""
HANDLE: Final = 2.6
"""Length of a line in a legend, in sizes of its letters."""
LETTERS: Final = 9
SMALL: Final = 8
"""Sizes in points: letters of labels and legends, and of the ticks' labels."""
INK: Final = "#222222"
SHORT: Final = "#E6E6E6"
"""The shade behind a last point that is the mean of fewer frames."""
FileKind = Literal["png", "pdf", "svg"]
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
    "text.parse_math": False,  # a dollar in a name is not a formula
    "savefig.facecolor": "white",
}
"""Matplotlib's settings for every figure; in an SVG, and so in a PDF, text stays text."""


def write_figures(
    folder: Path,
    drive: str,
    windows: pd.DataFrame,
    examples: Sequence[ExampleFrame],
    camera: str = "",
    *,
    width: float = WIDTH,
    titled: bool = True,
    kinds: Sequence[FileKind] = ("png", "pdf"),
) -> list[Path]:
    """Write every figure that has something to draw as files of ``kinds``; return their paths.

    The folder is made if it is missing. ``windows`` are the rows of ``windows.csv``, of any number
    of variants, or no rows without truth; ``examples`` are a few frames for figure 2; ``camera`` is
    the name of a camera of a rig, for titles and file names. Figures are ``width`` inches across.
    An OSError if the folder cannot be made; a `RoadevalError` if a file, or the system's folder for
    temporary files, cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    drive = f"{drive}, {camera}" if camera else drive
    ending = f"-{as_plain(camera)}" if camera else ""
    name = drive if titled else ""

    def draw() -> Iterator[tuple[str, bytes]]:
        """Yield each figure's name and its SVG."""
        with mpl.rc_context(RC):  # type: ignore[arg-type]
            if examples:
                yield f"fig2_masks{ending}", as_svg(road_masks(name, examples, width))
            for figure in OVER_DRIVE if len(windows) else ():
                yield f"{figure}{ending}", as_svg(over_drive(figure, name, windows, width))

    def write(named_svg: tuple[str, bytes]) -> list[Path]:
        (name, svg), paths = named_svg, []
        for kind in kinds:
            dpi = DPI if kind == "png" else None
            content = svg if kind == "svg" else typeset_figure(svg, kind, dpi)
            paths.append(write_file(folder / f"{name}.{kind}", content))
        return paths

    # Typst makes both files from one SVG in a few hundredths of a second, while the next figure is
    # drawn. Matplotlib would draw a figure once for each file, which takes ten times as long.
    return [path for paths in map_ordered(write, draw(), 1) for path in paths]


def as_svg(figure: Figure) -> bytes:
    """Return a figure as SVG."""
    content = BytesIO()
    figure.savefig(content, format="svg", dpi=DPI, metadata={"Date": None})
    return content.getvalue()


MARKED: Final = 25
"""Greatest number of markers along a line; a line with more points has markers at regular
distances."""
CROWDED: Final = 150
"""Greatest number of points of a line; more windows are drawn as means of neighbours."""
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
"""Greatest number of letters of a name in the legend."""
ERROR_RATE: Final = "fig3a_error_rate"
FP_FN_RATE: Final = "fig3b_fp_fn_rate"
OVER_DRIVE: Final[Mapping[str, tuple[str, Mapping[str, str]]]] = {
    ERROR_RATE: ("Error rate", {TESTED: "ERR: wrong pixels"}),
    FP_FN_RATE: (
        "False positive and false negative rate",
        {
            "FPR": "False positives (FPR)\nnon-road called road",
            "FNR": "False negatives (FNR)\nroad not found",
        },
    ),
}
"""The titles, rates and labels of the paper's figures 3a and 3b, by the names of their files."""


def over_drive(name: str, drive: str, windows: pd.DataFrame, width: float = WIDTH) -> Figure:
    """Draw a figure of `OVER_DRIVE`: the rates of each variant's final mask, one below the other.

    ``drive`` is the drive's name for the title; if it is empty, the figure has no title.
    """
    what, rates = OVER_DRIVE[name]
    title = f"{what} on {drive}" if drive else ""
    charts, across = over_windows(windows, [*rates]), width - AXIS - EDGE
    stages = ", ".join(values_of(finals(windows), "stage"))
    about = f"Final mask ({stages}); {describe_points(windows, CROWDED)}; lower is better."
    short = short_end(windows, CROWDED)
    size, words = (SMALL, {}) if width < NARROW else (LETTERS, _LABELS)
    names = [words.get(series.name, series.name) for series in charts[0].series]
    names += [f"mean of {counted(short[0], 'frame')}"] if short else []
    labels = [elide(name, _LONGEST) for name in names]
    longest = size * (0.57 * max(map(len, labels)) + HANDLE + 2)
    columns = min(max(int((72 * across + 1.2 * size) // longest), 1), 3)
    height = min(2.0, 0.55 * width)
    step = height + GAP_OF_AXES
    below = 0.2 * -(-len(labels) // columns) + step * len(charts) + FOOT
    figure = _titled(title, about, width, AXIS, below)
    total = figure.get_figheight()
    for place, (chart, label) in enumerate(zip(charts, rates.values(), strict=True)):
        bottom = FOOT + GAP_OF_AXES + step * (len(charts) - 1 - place)
        box = AXIS / width, bottom / total, across / width, height / total
        ax = figure.add_axes(box, sharex=figure.axes[0] if place else None)
        ax.set_ylabel(label)
        ax.yaxis.set_label_coords(-0.5 / across, 0.5)
        ax.tick_params(labelbottom=chart is charts[-1])
        _draw_rate(ax, chart)
        if short:
            ax.axvspan(*short[1:], color=SHORT, lw=0)
    axes = figure.axes
    axes[-1].xaxis.set_major_locator(MaxNLocator(nbins=int(1.2 * width) + 1, integer=True))
    axes[-1].set_xlabel("frame")
    keys: list[Any] = axes[0].get_lines()[::-1] + ([Patch(color=SHORT)] if short else [])
    # Matplotlib fills the columns of a legend one after the other; people read rows.
    in_rows = [p for column in range(columns) for p in range(column, len(labels), columns)]
    axes[0].legend(
        [keys[place] for place in in_rows],
        [labels[place] for place in in_rows],
        alignment="left",
        loc="lower left",
        bbox_to_anchor=(0, 1),
        borderaxespad=0.2,
        borderpad=0,
        ncols=columns,
        fontsize=size,
        handlelength=HANDLE,
        columnspacing=1.2,
    )
    return figure


def _draw_rate(ax: Axes, chart: Chart) -> None:
    """Draw a chart's series, the first one on top."""
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
        )
    highest = max([y for series in chart.series for _, y in series.points()], default=None)
    if highest is None:
        ax.text(0.5, 0.5, "undefined on every frame", transform=ax.transAxes, ha="center")
    ax.set_ylim(0, max(1.08 * (highest or 0), 0.5))
    ax.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
    ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g} %"))


def _titled(title: str, about: str, width: float, left: float, height: float) -> Figure:
    """Return a figure with a title and a text, unless the title is empty, above ``height`` inches.

    The title and the text are ``left`` inches from the edge.
    """
    bold: dict[str, Any] = {"size": 11, "weight": "bold", "color": INK, "va": "top"}
    faint: dict[str, Any] = {"size": 8.5, "color": FAINT, "va": "top"}
    room = width - left - EDGE
    lines = [(line, 0.22, bold) for line in wrap(visible(title), int(9 * room))]
    if title:
        lines += [(line, 0.17, faint) for line in wrap(about, int(14 * room))]
    total, down = EDGE + sum(step for _, step, _ in lines) + height, EDGE
    figure = Figure(figsize=(width, total))
    for line, step, look in lines:
        figure.text(left / width, 1 - down / total, line, **look)
        down += step
    return figure


LEFT: Final = 0.28
"""Inches left of the pictures, for the frames' numbers."""
NAMES: Final = 0.2
"""Inches above the pictures, for their names."""
GAP: Final = 0.05
"""Inches between pictures, and between a picture and its name."""


def road_masks(drive: str, examples: Sequence[ExampleFrame], width: float = WIDTH) -> Figure:
    """Draw figure 2 of the paper: the image alone, with each variant's mask, and with the truth."""
    rows = [*pictures_of([example.small() for example in examples])]
    pixels_down, pixels_across = rows[0]["camera image"].shape[:2]
    column_width = (width - LEFT) / len(rows[0])
    row_height = (column_width - GAP) * pixels_down / pixels_across + GAP
    title, below = f"Road masks on {drive}" if drive else "", NAMES + row_height * len(rows) + GAP
    truths = [example.truth for example in examples if example.truth is not None]
    ignored = any((truth == IGNORE).any() for truth in truths)
    variants = {variant for example in examples for variant in example.masks}
    missing = any(variants - example.masks.keys() for example in examples)
    legend = (
        "Green: road"
        + "; grey: ignored, counted nowhere" * ignored
        + "; faded: there is no mask of this frame" * missing
    )
    figure = _titled(title, legend, width, LEFT, below)
    figure_height = figure.get_figheight()
    top_of_rows = figure_height - below + NAMES
    size = LETTERS if width >= NARROW else 7

    def write(x: float, y: float, text: str, **look: Any) -> None:
        figure.text(x / width, 1 - y / figure_height, text, **look)

    for row, (example, pictures) in enumerate(zip(examples, rows, strict=True)):
        top = top_of_rows + row * row_height
        bottom = top + row_height - GAP
        name = f"frame {example.frame}" if row_height > 0.7 else str(example.frame)
        beside = {"rotation": 90, "ha": "right", "va": "center", "size": SMALL, "color": FAINT}
        write(LEFT - GAP, (top + bottom) / 2, name, **beside)
        for column, (title, picture) in enumerate(pictures.items()):
            left, right = LEFT + column * column_width, LEFT + (column + 1) * column_width - GAP
            low, high = 1 - bottom / figure_height, 1 - top / figure_height
            FigurePicture(
                figure, picture, Bbox.from_extents(left / width, low, right / width, high)
            )
            if row == 0:
                name = "camera" if column == 0 and width < NARROW else title
                name = elide(name, max(int(120 / size * column_width), 3))
                above = {"size": size, "color": INK, "ha": "center", "va": "bottom"}
                write((left + right) / 2, top_of_rows - GAP, name, **above)
    return figure


class FigurePicture(FigureImage):
    """An ``(H, W, 3)`` uint8 RGB image that fills a box; the box is in shares of the figure.

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
