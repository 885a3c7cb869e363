"""Forest plot: every drive's difference with its interval, and below them the mean over drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from roadeval.data import colours
from roadeval.data.words import points
from roadeval.report.figures.charts import LEAST, WIDTH
from roadeval.report.figures.layout import short
from roadeval.report.figures.style import FAINT, INK, PALE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMED: Final = 60
"""More drives than this stand without their names, but for the extremes."""
EXTREMES: Final = 3
"""Drives named at either end, where not all are."""
LONGEST: Final = 32
"""Letters of a name, at most."""
ROW: Final = 0.17
"""Inches that a named drive takes; in long plots a little less."""
CATERPILLAR: Final = 3.3
"""Inches that drives without names take together."""
BELOW: Final = 1.2
"""Rows below the last drive, for the mean."""
WIDEST: Final = 0.9
"""The share of the drives' intervals that are seen whole; an axis for all would hide the rest."""
WORSE: Final = colours.hex_of(colours.VERMILLION)
BETTER: Final = colours.hex_of(colours.BLUE)


@dataclass(frozen=True, slots=True)
class ForestRow:
    """A drive: its name and group, its difference (lower is better), its interval if it has one."""

    name: str
    group: str | None
    mean: float
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class ForestMean:
    """The mean over drives with its interval, None if unknown. Fractions, as the drives' own."""

    mean: float
    low: float | None
    high: float | None


def forest(rows: Sequence[ForestRow], mean: ForestMean, label: str) -> Figure:
    """Draw a row a drive, the worst above, and below them the mean over drives.

    Parameters
    ----------
    rows
        The drives, in any order; one at least.
    mean
        Over them.
    label
        Of the axis, as ``difference of ERR, pp``.
    """
    from matplotlib.figure import Figure

    rows = sorted(rows, key=lambda row: (-row.mean, row.name))
    figure = Figure(figsize=(WIDTH, height(len(rows))), layout="constrained")
    ax = figure.subplots()
    scale = len(rows) / (CATERPILLAR / ROW) if len(rows) > NAMED else 1.0
    _limit(ax, rows, mean)
    _drives(ax, rows)
    _summary(ax, mean, len(rows) - 0.5, scale)
    ax.axvline(0, color=FAINT, linewidth=0.8, zorder=1)
    ax.set_ylim(len(rows) - 0.5 + BELOW * scale, -0.7 * scale)
    ax.set_xlabel(label)
    ax.grid(axis="x")
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)
    ax.spines["left"].set_visible(False)
    for place, word, side in ((0.0, "better", "left"), (1.0, "worse", "right")):
        ax.text(place, 1.0, word, transform=ax.transAxes, ha=side, va="bottom", color=FAINT, size=8)
    return figure


def height(drives: int) -> float:
    """Return the inches that a plot of so many drives is high."""
    if drives > NAMED:
        return CATERPILLAR + 1.1
    return 0.75 + (drives + BELOW) * (ROW if drives <= 40 else 0.85 * ROW)


def cut(rows: Sequence[ForestRow], mean: ForestMean) -> int:
    """Count the drives whose interval reaches beyond the plot."""
    low, high = limits(rows, mean)
    ends = [(row.low, row.high) for row in rows if row.low is not None and row.high is not None]
    return sum(100 * a < low or 100 * b > high for a, b in ends)


def limits(rows: Sequence[ForestRow], mean: ForestMean) -> tuple[float, float]:
    """Return the ends of the axis in percentage points: every mean is seen, and most intervals."""
    wanted = [row.mean for row in rows] + [0.0, LEAST / 100, -LEAST / 100]
    wanted += [end for end in (mean.low, mean.high) if end is not None]
    for ends, share in (
        ([row.low for row in rows if row.low is not None], 1 - WIDEST),
        ([row.high for row in rows if row.high is not None], WIDEST),
    ):
        if ends:
            wanted.append(float(np.quantile(ends, share)))
    low, high = 100 * min(wanted), 100 * max(wanted)
    margin = 0.04 * (high - low)
    return low - margin, high + margin


def _limit(ax: Axes, rows: Sequence[ForestRow], mean: ForestMean) -> None:
    ax.set_xlim(*limits(rows, mean))
    ax.set_autoscalex_on(False)


def _drives(ax: Axes, rows: Sequence[ForestRow]) -> None:
    """Draw the drives' intervals and means, named where there is room."""
    named = len(rows) <= NAMED
    places = np.arange(len(rows))
    means = 100 * np.array([row.mean for row in rows])
    for sign, colour in ((1, WORSE), (-1, BETTER), (0, FAINT)):
        own = np.flatnonzero(np.sign(means) == sign)
        lines = [_line(rows[place], place) for place in own.tolist()]
        x, y = np.array([point for line in lines for point in line]).reshape(-1, 2).T
        # One path, with gaps: thousands of single ones would make a file of megabytes.
        width, alpha = (1.3, 1.0) if named else (0.6, 0.35)
        ax.plot(x, y, color=colour, linewidth=width, alpha=alpha, zorder=2)
        size = 4.0 if named else max(0.8, 2.4 - len(rows) / 1000)
        ax.plot(means[own], places[own], "o", color=colour, markersize=size, zorder=3, mew=0)
    if named:
        size = 7 if len(rows) <= 40 else 6
        ax.set_yticks(places, [short(row.name, LONGEST) for row in rows], size=size)
        _groups(ax, rows, size)
        return
    ax.set_yticks([])
    _extremes(ax, rows)


def _line(row: ForestRow, place: int) -> list[tuple[float, float]]:
    """Return the points of a drive's interval, and a gap after it; none where it has none."""
    if row.low is None or row.high is None:
        return []
    return [(100 * row.low, place), (100 * row.high, place), (np.nan, place)]


def _groups(ax: Axes, rows: Sequence[ForestRow], size: float) -> None:
    """Write the drives' groups at the right edge."""
    for place, row in enumerate(rows):
        if row.group:
            ax.annotate(
                short(row.group, 20),
                (1, place),
                xycoords=("axes fraction", "data"),
                xytext=(4, 0),
                textcoords="offset points",
                va="center",
                color=FAINT,
                size=size,
                annotation_clip=False,
            )


def _extremes(ax: Axes, rows: Sequence[ForestRow]) -> None:
    """Name the drives at either end, in the free corners beside them."""
    high = "\n".join(_told(row) for row in rows[:EXTREMES])
    low = "\n".join(_told(row) for row in rows[-EXTREMES:])
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.5}
    for x, y, words, side, end in (
        (0.01, 0.99, high, "left", "top"),
        (0.99, 0.2, low, "right", "bottom"),
    ):
        ax.text(
            *(x, y, words),
            transform=ax.transAxes,
            ha=side,
            va=end,
            size=7,
            color=INK,
            bbox=box,
            zorder=6,
        )


def _told(row: ForestRow) -> str:
    return f"{short(row.name, LONGEST)} {points(row.mean)}"


def _summary(ax: Axes, mean: ForestMean, top: float, scale: float) -> None:
    """Draw the mean as a diamond as wide as its interval."""
    ax.axhspan(top, top + BELOW * scale, color=PALE, alpha=0.45, linewidth=0, zorder=0)
    place = top + 0.6 * scale
    middle = 100 * mean.mean
    if mean.low is not None and mean.high is not None:
        ends = 100 * mean.low, 100 * mean.high
        half = 0.38 * scale
        x = [ends[0], middle, ends[1], middle]
        y = [place, place - half, place, place + half]
        ax.fill(x, y, color=INK, zorder=4, linewidth=0.8)
    else:
        ax.plot([middle], [place], "D", color=INK, markersize=5, zorder=4)
    ticks = list(ax.get_yticks()), [label.get_text() for label in ax.get_yticklabels()]
    size = ax.get_yticklabels()[0].get_fontsize() if ticks[0] else 7
    ax.set_yticks([*ticks[0], place], [*ticks[1], "mean over drives"], size=size)
    ax.get_yticklabels()[-1].set_fontweight("bold")
