"""Rates of the final masks over the drive, a line a variant, as in the paper's figure 3."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import Rows
from roadeval.data.rows import Cells
from roadeval.data.words import listing
from roadeval.evaluation import scored
from roadeval.evaluation.metrics import METRICS
from roadeval.report.figures.legend import LegendStyle, room_in
from roadeval.report.figures.style import Look, heading, looks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CROWDED: Final = 150
"""More windows than this are drawn as means of several, with their range as a band."""
PALE: Final = 0.4
"""Opacity of a last row that holds fewer frames than the others, and of the line to it."""
MARKED: Final = 25
"""Up to this many points each has its marker; beyond, about as many do."""
WIDTH: Final = 8
"""Inches across the figure."""
ROOM: Final = room_in(WIDTH)
LINE: Final = 0.2
"""Inches from one line of the legend to the next."""
LEGEND: Final = LegendStyle(columns=3, handlelength=3.4)


def rates_over_drive(
    title: str, windows: Rows, rates: Mapping[str, str], height: float
) -> Figure | None:
    """Draw rates of each variant's final mask, one below the other.

    Parameters
    ----------
    title
        Of the figure.
    windows
        As ``windows.csv``; without a row there is no figure.
    rates
        Columns of ``windows``, each with the title of its axis.
    height
        Of the figure with one line of legend, in inches.
    """
    from matplotlib.figure import Figure

    if not len(windows):
        return None
    final = scored.finals(windows)
    rows = scored.each_window(final)
    group = -(-len(rows) // CROWDED)
    size, rest = rows["frames"].max(), rows["frames"][-1]
    last, short = rows["window"][-1], ""
    if rest < size and group > 1:
        final, rows = final.take(final["window"] < last), rows.take(slice(-1))
        short = f"; a last row of {rest} is left out"
    elif rest < size:
        short = f"; the last row, drawn pale, holds {rest}"
    names = [look.label for look in looks(final.distinct("variant")).values()]
    lines = LEGEND.lines(LEGEND.short(names, ROOM), ROOM)
    height += LINE * (lines - 1)
    figure = Figure(figsize=(WIDTH, height))
    heading(figure, title, _subtitle(final, rows, group, rates))
    axes = figure.subplots(len(rates), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (rate, name) in zip(axes, rates.items(), strict=True):
        _draw(ax, final, rate, group, pale=last if short else None)
        ax.set_ylabel(name)
    _label_rows(axes[-1], rows, short)
    _legend(figure, axes[0])
    top = 1 - (0.66 + LINE * lines) / height
    figure.subplots_adjust(left=0.11, right=0.985, bottom=0.55 / height, top=top, hspace=0.13)
    figure.align_ylabels(axes)
    return figure


def _subtitle(final: Rows, rows: Rows, group: int, rates: Collection[str]) -> str:
    stages, size = ", ".join(final.distinct("stage")), rows["frames"].max()
    each = f"each point is the mean of {size} frames" if size > 1 else "each point is one frame"
    if group > 1:
        each = f"each point averages {group} rows of {size} frames, the band spans them"
    return f"Final mask ({stages}); {each}; {_direction(rates)}"


def _direction(rates: Collection[str]) -> str:
    rising = [rate for rate in rates if METRICS[rate].higher_is_better]
    if not rising:
        return "lower is better"
    if len(rising) == len(rates):
        return "higher is better"
    return f"higher is better for {listing(rising)}, lower for the others"


def _draw(ax: Axes, final: Rows, rate: str, group: int, pale: int | None) -> None:
    from matplotlib.ticker import MaxNLocator, StrMethodFormatter

    for name, look in looks(final.distinct("variant")).items():
        own = final.of_variant(name)
        own = own.take(np.argsort(own["window"], kind="stable"))
        _line(ax, own["window"], 100 * own[rate], look, group, pale=pale)
    values = 100 * final[rate]
    if np.isnan(values).all():
        ax.text(0.5, 0.5, "undefined on every frame", transform=ax.transAxes, ha="center")
    if not METRICS[rate].higher_is_better:
        ax.set_ylim(0, max(1.08 * np.nanmax([*values, 0.1]), 0.5))
    ax.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
    ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g} %"))


def _line(ax: Axes, x: Cells, y: Cells, look: Look, group: int, *, pale: int | None) -> None:
    """Draw a variant's series; with too many rows to tell apart, their mean and range.

    ``pale`` is the number of a last row that does not count as much as the others.
    """
    if group > 1:
        starts = np.arange(0, len(x), group)
        low, high = np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)
        x, y = _means(x, starts), _means(y, starts)
        ax.fill_between(x, low, high, color=look.colour, alpha=0.15, linewidth=0)
    drawn: dict[str, Any] = {**look.line, **look.mark, "markersize": 5, "clip_on": False}
    every = -(-len(x) // MARKED)
    if len(x) > 1 and x[-1] == pale:
        ax.plot(x[-2:], y[-2:], **drawn, alpha=PALE, markevery=[1], zorder=look.order - 1)
        x, y = x[:-1], y[:-1]
    ax.plot(x, y, **drawn, label=look.label, markevery=every, zorder=look.order)


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


def _legend(figure: Figure, ax: Axes) -> None:
    """Write the legend above the axes."""
    handles, labels = ax.get_legend_handles_labels()
    labels = LEGEND.short(labels, ROOM)
    figure.legend(
        handles,
        labels,
        loc="upper left",
        bbox_to_anchor=(0.0, 1 - 0.5 / figure.get_figheight()),
        **LEGEND.arguments(labels, ROOM),
    )
