"""Where the axes of a chart and the names around them lie, in points.

Margins follow from the letters in them, which are measured one by one. Matplotlib's own layouts
find the same by drawing the figure again and again, which takes longer than drawing it once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from roadeval.runtime.text import visible

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

INCH: Final = 72
"""Points in an inch."""
LETTERS: Final = 9
SMALL: Final = 8
"""Points of labels, titles and legends, and of the ticks' labels, as `style.RC` has them."""
EDGE: Final = 6
"""Points that stay free along the figure's edges, and between words side by side."""
TICKS: Final = 7
"""Points from the axes to the ticks' labels."""
LINE: Final = 16
"""Points that a label or a title takes with its distance from what it names."""
TICKED: Final = TICKS + SMALL + 5
"""Points below axes with labelled ticks."""
BELOW: Final = TICKED + LINE
"""Points below axes with labelled ticks and a label."""
AXES: Final = 0.7
"""Share of a column's width that its axes have, about: with it labels beyond them are measured."""
NAMES: Final = 0.4
"""Share of a figure's width that names at its left take, at most."""
TILT: Final = 45
"""Degrees by which names below the axes are turned where they have no room side by side."""


def width_of(text: str, size: float = SMALL) -> float:
    """Return the width of a line of text in points, as the canvas of an SVG measures it."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(size=size)
    width: float = text_to_path.get_text_width_height_descent(text, font, ismath=False)[0]
    return width


def short(name: str, letters: int) -> str:
    """Return a name, its middle left out where it is long: both ends tell names apart."""
    name = visible(name)
    if len(name) <= letters:
        return name
    half = (letters - 1) // 2
    return f"{name[: letters - 1 - half]}\N{HORIZONTAL ELLIPSIS}{name[len(name) - half :]}"


def fitting(name: str, room: float, size: float = SMALL) -> str:
    """Return a name in as many letters as fit into so many points; three at least."""
    name = visible(name)
    letters = len(name)
    while letters > 3 and width_of(short(name, letters), size) > room:
        letters -= 1
    return short(name, letters)


def place(
    figure: Figure, axes: Sequence[Axes], *, top: float, bottom: float, down: float = 0
) -> None:
    """Place the axes of a grid so that what is written around them has room.

    Parameters
    ----------
    figure
        Whose axes they are.
    axes
        Of one grid, row by row.
    top, bottom, down
        Points above, below and between its rows. Those beside and between its columns follow
        from the labels of the ticks.
    """
    _plain(axes)
    grid = _spec(axes[0]).get_gridspec()
    width, height = INCH * figure.get_size_inches()
    figure.subplots_adjust(
        bottom=bottom / height,
        top=1 - top / height,
        hspace=_share(down, height - top - bottom, grid.nrows),
    )
    # The ticks follow from the height, the room beside the axes from the ticks.
    beside = [(_spec(ax).is_first_col(), _left_of(ax)) for ax in axes]
    left = EDGE + max(room for first, room in beside if first)
    ends = [_beyond(ax, AXES * width / grid.ncols) for ax in axes]
    before, after = (max(each) for each in zip(*ends, strict=True))
    across = max([before + after, *(room for first, room in beside if not first)])
    left = max(left, EDGE + before)
    figure.subplots_adjust(
        left=left / width,
        right=1 - (EDGE + after) / width,
        wspace=_share(2 * EDGE + across, width - left - EDGE - after, grid.ncols),
    )


def _spec(ax: Axes) -> SubplotSpec:
    """Return where axes are in their grid."""
    spec = ax.get_subplotspec()
    assert spec is not None
    return spec


def _plain(axes: Iterable[Axes]) -> None:
    """Write numbers at the ticks as they are: a power of ten beside the axis has no room."""
    from matplotlib.ticker import ScalarFormatter

    for axis in (axis for ax in axes for axis in (ax.xaxis, ax.yaxis)):
        formatter = axis.get_major_formatter()
        if isinstance(formatter, ScalarFormatter):
            formatter.set_useOffset(False)
            formatter.set_scientific(False)


def _share(gap: float, room: float, count: int) -> float:
    """Return the gap between ``count`` axes that share a room, as Matplotlib has it."""
    return gap * count / (room - gap * (count - 1))


def _left_of(ax: Axes) -> float:
    """Return the points that the words left of the axes take."""
    label = LINE if ax.get_ylabel() else 0
    if not ax.yaxis.get_tick_params().get("labelleft", True):
        return label
    return label + max((TICKS + width_of(text) for _, text in _ticks(ax.yaxis)), default=0)


def _ticks(axis: Axis) -> list[tuple[float, str]]:
    """Return the places of an axis's ticks, 0 to 1 along it, with their labels."""
    low, high = axis.get_view_interval()
    places = axis.get_major_locator()()
    texts = axis.get_major_formatter().format_ticks(list(places))
    shares = [(at - low) / (high - low) for at in places]
    return [(share, text) for share, text in zip(shares, texts, strict=True) if 0 <= share <= 1]


def _beyond(ax: Axes, width: float) -> tuple[float, float]:
    """Return how far labels reach beyond either end of axes of a width, all in points."""
    marks = ax.xaxis.get_major_ticks()
    turned = np.deg2rad(marks[0].label1.get_rotation()) if marks else 0.0
    before = after = 0.0
    for at, text in _ticks(ax.xaxis):
        # One that is turned ends at its tick.
        half = width_of(text) * (np.cos(turned) if turned else 0.5)
        before = max(before, half - at * width)
        after = max(after, (0 if turned else half) - (1 - at) * width)
    return before, after


def place_rows(
    figure: Figure, axes: Iterable[Axes], height: float, *, top: float, bottom: float
) -> None:
    """Place axes that are so many points high each; the figure becomes as high as that takes.

    ``top`` and ``bottom`` are the points above and below them; each row has a title.
    """
    axes = list(axes)
    rows = _spec(axes[0]).get_gridspec().nrows
    down = bottom + LINE + EDGE
    total = top + rows * height + (rows - 1) * down + bottom
    figure.set_figheight(total / INCH)
    place(figure, axes, top=top, bottom=bottom, down=down)


def place_maps(figure: Figure, rows: int, ratio: float) -> list[Axes]:
    """Place maps of a height of ``ratio`` times their width; return axes for the colours' scales.

    The figure becomes as high as that takes.
    """
    across = INCH * figure.get_figwidth()
    left, between, scale = EDGE + LINE, 3 * EDGE, EDGE
    width = (across - left - between - 2 * EDGE) / 2
    height = ratio * width
    top, bottom = EDGE + LINE, BELOW + scale + EDGE
    total = top + rows * height + (rows - 1) * EDGE + bottom
    figure.set_figheight(total / INCH)
    figure.subplots_adjust(
        left=left / across,
        right=1 - 2 * EDGE / across,
        top=1 - top / total,
        bottom=bottom / total,
        wspace=between / width,
        hspace=EDGE / height,
    )
    sides = (left, left + width + between)
    size = width / across, scale / total
    return [figure.add_axes((side / across, BELOW / total, *size)) for side in sides]


def name_columns(ax: Axes, names: Sequence[str], room: float) -> float:
    """Name the places 0, 1, ... below the axes; return the points that the names take.

    They are turned where ``room`` points are not enough for all of them side by side.
    """
    names = [fitting(name, room) for name in names]
    ax.set_xticks(range(len(names)), names)
    step = room / max(len(names), 1)
    widths = [width_of(name) for name in names]
    if all(sum(pair) / 2 + EDGE <= step for pair in pairwise(widths)):
        return TICKED
    ax.tick_params(axis="x", labelrotation=TILT)
    for label in ax.get_xticklabels():
        label.set(horizontalalignment="right", rotation_mode="anchor")
    turned = np.deg2rad(TILT)
    return float(TICKED + max(widths) * np.sin(turned))
