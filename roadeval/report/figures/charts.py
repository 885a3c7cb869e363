"""Charts that only a PDF shows: each draws a table of the findings or of a comparison."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE
from roadeval.data.words import in_percent
from roadeval.evaluation.analysis import merged
from roadeval.evaluation.metrics import SHORT
from roadeval.report.figures.layout import (
    BELOW,
    EDGE,
    INCH,
    LETTERS,
    LINE,
    NAMES,
    TICKED,
    fitting,
    name_columns,
    place,
    place_rows,
)
from roadeval.report.figures.legend import LegendStyle, legend
from roadeval.report.figures.style import FAINT, INK, PALE, Look, looks

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from roadeval.evaluation.comparison_result import MaskComparison
    from roadeval.report.findings import Totals

WIDTH: Final = 7.4
"""Inches across a chart; a page's text is 6.7 wide, so letters come out a little smaller."""
PER_ROW: Final = 3
"""Rates that are drawn beside each other."""
STAGES: Final = 140
"""Points across the names of the stages below one chart of rates, about."""
BARS: Final = 400
"""More frames than this are drawn as means of neighbours."""
LEAST: Final = 0.1
"""Percentage points on either side of zero that are shown at least: less may be rounding."""


def difference(frames: pd.DataFrame, treated: str, control: str, mean: Mapping[str, Any]) -> Figure:
    """Draw the paired difference of ERR over the drive, and its mean with the interval.

    Parameters
    ----------
    frames
        Indexed by ``frame``, with a column ``ERR``.
    treated, control
        The variants, for their colours.
    mean
        The mean difference as in ``summary.json``.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 2.6))
    ax = figure.subplots()
    group = max(-(-len(frames) // BARS), 1)
    places = np.arange(0, len(frames), group)
    rows = frames["ERR"].groupby(np.arange(len(frames)) // group)
    values = 100 * rows.mean().fillna(0).to_numpy()
    look = looks([treated, control])
    for name, wanted in ((control, values > 0), (treated, values <= 0)):
        ax.bar(
            places[wanted] + (group - 1) / 2, values[wanted], 0.86 * group, color=look[name].colour
        )
    if mean["low"] is not None:
        ax.axhspan(100 * mean["low"], 100 * mean["high"], color=INK, alpha=0.12, linewidth=0)
    ax.axhline(100 * mean["mean"], color=INK, linewidth=1.2, linestyle=(0, (4, 2)))
    ax.axhline(0, color=FAINT, linewidth=0.8)
    _frame_ticks(ax, frames.index.to_numpy())
    ax.set_ylabel("difference of ERR, pp")
    ax.margins(y=0.12)
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, -LEAST), max(high, LEAST))
    for height, align, word in ((0.98, "top", "worse"), (0.02, "bottom", "better")):
        ax.text(
            *(0.006, height, f"{treated} {word}"),
            transform=ax.transAxes,
            va=align,
            color=FAINT,
            size=8,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.5},
        )
    place(figure, [ax], top=EDGE, bottom=BELOW)
    return figure


def regions(table: pd.DataFrame, variants: Sequence[str], titles: Mapping[str, str]) -> Figure:
    """Draw the error rate in each region, and its share of the pixels and of the errors.

    Parameters
    ----------
    table
        ``variant``, ``region``, ``ERR``, ``pixels`` and ``errors``.
    variants
        Those to draw, in order.
    titles
        The regions to draw, from top to bottom, with their titles.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 3))
    left, right = figure.subplots(1, 2, sharey=True)
    rows = np.arange(len(titles))
    pixels = table.drop_duplicates("region").set_index("region")["pixels"].reindex([*titles])
    right.barh(rows, 100 * pixels, 0.7, color=PALE, label="share of the pixels")
    for name, look in looks(variants).items():
        own = table[table["variant"] == name].set_index("region").reindex([*titles])
        for ax, column in ((left, "ERR"), (right, "errors")):
            _marks(ax, 100 * own[column].to_numpy(float), rows, look)
    left.set_yticks(rows, _beside(titles.values()))
    left.invert_yaxis()
    left.set_xlabel("ERR within the region, %")
    right.set_xlabel("share of the wrong pixels, %")
    for ax in (left, right):
        ax.set_xlim(left=0)
        ax.grid(axis="x")
    handles, labels = left.get_legend_handles_labels()
    more, also = right.get_legend_handles_labels()
    lines = legend(
        figure,
        [*handles, more[also.index("share of the pixels")]],
        [*(label.partition(":")[0] for label in labels), "share of the pixels"],
        LegendStyle(columns=len(labels) + 1, handlelength=1.5),
    )
    place_rows(figure, [left, right], 16.5 * len(titles), top=lines + EDGE, bottom=BELOW)
    return figure


def stages(totals: Totals) -> Figure:
    """Draw the rates of each stage's mask, a line a variant."""
    figure, grid = _rate_axes()
    names = merged(own for variant, own in totals.items() if variant != BASELINE)
    below = 0.0
    for rate, ax in grid.items():
        _stage_lines(ax, totals, names, rate)
        below = name_columns(ax, names, STAGES)
        ax.set_xlim(-0.3, len(names) - 0.7)
        if not SHORT[rate].higher_is_better:
            ax.set_ylim(bottom=0)
        ax.set_title(f"{rate}, %", loc="left", y=1)
    place_rows(figure, grid.values(), 123, top=_legend(figure, list(totals)) + LINE, bottom=below)
    return figure


def _stage_lines(ax: Axes, totals: Totals, names: Sequence[str], rate: str) -> None:
    """Draw a line a variant over the stages, and the baseline as a level."""
    for variant, look in looks(list(totals)).items():
        values = np.array([in_percent(total.get(rate)) for total in totals[variant].values()])
        if variant == BASELINE:
            ax.axhline(values[0], **look.line)
        else:
            places = np.array([names.index(stage) for stage in totals[variant]])
            ax.plot(places, values, **look.line)
            _marks(ax, places, values, look)


def coverage(table: pd.DataFrame) -> Figure:
    """Draw the share of the image that each variant calls road; ``table`` is indexed by frame."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 2.6))
    ax = figure.subplots()
    for name, look in looks(list(table.columns)).items():
        ax.plot(table.index.to_numpy(), 100 * table[name], **look.line)
    ax.set_xlabel("frame")
    ax.set_ylabel("image called road, %")
    ax.set_ylim(bottom=0)
    place(figure, [ax], top=_legend(figure, list(table.columns)) + EDGE, bottom=BELOW)
    return figure


def forest(changes: Sequence[MaskComparison]) -> Figure:
    """Draw each result's changes of rates against the base, with their intervals."""
    figure, grid = _rate_axes(sharey=True)
    for rate, ax in grid.items():
        for row, each in enumerate(changes):
            change = each.difference[rate]
            ax.plot(in_percent(change.mean), row, "o", color=INK, markersize=5)
            if change.low is not None and change.high is not None:
                ends = [100 * change.low, 100 * change.high]
                ax.plot(ends, [row, row], color=INK, linewidth=1.6)
        ax.axvline(0, color=FAINT, linewidth=0.8)
        ax.margins(x=0.15)
        low, high = ax.get_xlim()
        ax.set_xlim(min(low, -LEAST), max(high, LEAST))
        ax.set_title(f"{rate}, pp", loc="left", y=1)
        ax.grid(axis="x")
        ax.grid(visible=False, axis="y")
    first = next(iter(grid.values()))
    first.set_yticks(range(len(changes)), _beside(row.name for row in changes))
    first.set_ylim(len(changes) - 0.5, -0.5)
    place_rows(figure, grid.values(), 18.7 * len(changes) + LETTERS, top=EDGE + LINE, bottom=TICKED)
    return figure


def levels(rows: Sequence[MaskComparison]) -> Figure:
    """Draw the rates of several results' final masks, a line of marks a result."""
    results = list(dict.fromkeys(row.result for row in rows))
    variants = list(dict.fromkeys(row.variant for row in rows))
    figure, grid = _rate_axes(sharey=True)
    for rate, ax in grid.items():
        for variant, look in looks(variants).items():
            own = [row for row in rows if row.variant == variant]
            values = [in_percent(row.new[rate]) for row in own]
            _marks(ax, values, [results.index(row.result) for row in own], look)
        ax.set_title(f"{rate}, %", loc="left", y=1)
        if not SHORT[rate].higher_is_better:
            ax.set_xlim(left=0)
        ax.grid(axis="x")
    first = next(iter(grid.values()))
    first.set_yticks(range(len(results)), _beside(results))
    first.set_ylim(len(results) - 0.5, -0.5)
    lines = _legend(figure, variants)
    place_rows(figure, grid.values(), 23 * len(results) + LETTERS, top=lines + LINE, bottom=TICKED)
    return figure


def _rate_axes(*, sharey: bool = False) -> tuple[Figure, dict[str, Axes]]:
    """Return a figure with axes for each rate, `PER_ROW` beside each other."""
    from matplotlib.figure import Figure

    rows, columns = -(-len(SHORT) // PER_ROW), min(len(SHORT), PER_ROW)
    figure = Figure(figsize=(WIDTH, 3))
    grid = figure.subplots(rows, columns, sharey=sharey, squeeze=False).ravel()
    for spare in grid[len(SHORT) :]:
        spare.remove()
    return figure, dict(zip(SHORT, grid, strict=False))


def _beside(names: Iterable[str]) -> list[str]:
    """Return names as they are written left of the axes."""
    return [fitting(name, NAMES * WIDTH * INCH) for name in names]


def _marks(ax: Axes, x: Any, y: Any, look: Look) -> None:
    """Draw a variant's marks, and no line between them."""
    ax.plot(
        x,
        y,
        **{**look.line, **look.mark, "linestyle": "none"},
        label=look.label,
        markersize=5.5,
        zorder=look.order + 1,
        clip_on=False,
    )


def _legend(figure: Figure, variants: Sequence[str]) -> float:
    """Write above the axes which variant is drawn how; return the points that this takes."""
    from matplotlib.lines import Line2D

    handles = []
    for name, look in looks(variants).items():
        mark = {} if name == BASELINE else look.mark
        handles.append(Line2D([], [], **look.line, **mark, markersize=5))
    return legend(figure, handles, variants, LegendStyle())


def _frame_ticks(ax: Axes, frames: Any) -> None:
    """Label places along the evaluated frames with round numbers of frames."""
    from matplotlib.ticker import MaxNLocator

    wanted = MaxNLocator(nbins=10, integer=True).tick_values(frames[0], frames[-1])
    wanted = wanted[(wanted >= frames[0]) & (wanted <= frames[-1])]
    places = np.unique(np.searchsorted(frames, wanted))
    ax.set_xticks(places, [str(frame) for frame in frames[places]])
    ax.set_xlim(-0.5, len(frames) - 0.5)
    ax.set_xlabel("frame")
