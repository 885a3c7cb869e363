"""Charts that only a PDF shows: each draws a table of the findings or of a comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE, colours
from roadeval.data.words import in_percent
from roadeval.evaluation.metrics import SHORT
from roadeval.report.figures.style import FAINT, INK, PALE, Look, looks
from roadeval.report.figures.values import tops_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from roadeval.evaluation.comparison_result import MaskComparison
    from roadeval.report.findings import ErrorHeatmap, Totals

WIDTH: Final = 7.4
"""Inches across a chart; a page's text is 6.7 wide, so letters come out a little smaller."""
MAPS_SHARE: Final = 0.68
"""Share of the page's width that `heatmap` is drawn for, so that its letters keep their size."""
PER_ROW: Final = 3
"""Rates that are drawn beside each other."""
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

    figure = Figure(figsize=(WIDTH, 2.6), layout="constrained")
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
    for height, align, word in ((0.98, "top", "worse"), (0.02, "bottom", "better")):
        ax.text(
            *(0.006, height, f"{treated} {word}"),
            transform=ax.transAxes,
            va=align,
            color=FAINT,
            size=8,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.5},
        )
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

    figure = Figure(figsize=(WIDTH, 0.75 + 0.24 * len(titles)), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    rows = np.arange(len(titles))
    pixels = table.drop_duplicates("region").set_index("region")["pixels"].reindex([*titles])
    right.barh(rows, 100 * pixels, 0.7, color=PALE, label="share of the pixels")
    for name, look in looks(variants).items():
        own = table[table["variant"] == name].set_index("region").reindex([*titles])
        for ax, column in ((left, "ERR"), (right, "errors")):
            _marks(ax, 100 * own[column].to_numpy(float), rows, look)
    left.set_yticks(rows, list(titles.values()))
    left.invert_yaxis()
    left.set_xlabel("ERR within the region, %")
    right.set_xlabel("share of the wrong pixels, %")
    for ax in (left, right):
        ax.set_xlim(left=0)
        ax.grid(axis="x")
    handles, labels = left.get_legend_handles_labels()
    more, also = right.get_legend_handles_labels()
    figure.legend(
        [*handles, more[also.index("share of the pixels")]],
        [*(label.partition(":")[0] for label in labels), "share of the pixels"],
        loc="outside upper left",
        ncols=len(labels) + 1,
        handlelength=1.5,
    )
    return figure


def stages(totals: Totals) -> Figure:
    """Draw the rates of each stage's mask, a line a variant."""
    figure, grid = _rate_axes(2.5)
    names = list(dict.fromkeys(s for v, own in totals.items() for s in own if v != BASELINE))
    for rate, ax in grid.items():
        _stage_lines(ax, totals, names, rate)
        ax.set_xticks(range(len(names)), names)
        ax.set_xlim(-0.3, len(names) - 0.7)
        if not SHORT[rate].higher_is_better:
            ax.set_ylim(bottom=0)
        ax.set_title(f"{rate}, %", loc="left")
    _legend(figure, list(totals))
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


def heatmap(maps: Sequence[ErrorHeatmap], among: Sequence[ErrorHeatmap] | None = None) -> Figure:
    """Draw where false positives and false negatives are, a row a variant.

    Equal shades are equal shares in all maps ``among`` which these are; by default these alone.
    """
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.figure import Figure

    height, width = maps[0].fp.shape
    across = MAPS_SHARE * WIDTH
    row = (across - 0.9) / 2 * height / width
    figure = Figure(figsize=(across, (row + 0.1) * len(maps) + 0.5), layout="constrained")
    grid = figure.subplots(len(maps), 2, squeeze=False)
    columns = (
        ("FP: non-road called road", colours.FP, [each.fp for each in maps]),
        ("FN: road missed", colours.FN, [each.fn for each in maps]),
    )
    tops = tops_of(among or maps)
    for axes, (title, colour, shares), top in zip(grid.T, columns, tops, strict=True):
        shades = ["white", colours.hex_of(colour), colours.hex_of(colours.MOST_ERRORS)]
        bad = colours.hex_of(colours.NEVER_LABELLED)
        palette = LinearSegmentedColormap.from_list("", shades).with_extremes(bad=bad)
        for ax, share in zip(axes, shares, strict=True):
            drawn = ax.imshow(100 * share, cmap=palette, vmin=0, vmax=100 * top, aspect="auto")
            ax.set_xticks([])
            ax.set_yticks([])
            ax.spines[:].set_visible(True)
        axes[0].set_title(title, loc="left")
        bar = figure.colorbar(drawn, ax=axes, location="bottom", aspect=30, pad=0.02)
        bar.set_label("% of the frames")
        bar.outline.set_visible(False)
    for ax, each in zip(grid[:, 0], maps, strict=True):
        ax.set_ylabel(each.variant)
    return figure


def coverage(table: pd.DataFrame) -> Figure:
    """Draw the share of the image that each variant calls road; ``table`` is indexed by frame."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 2.6), layout="constrained")
    ax = figure.subplots()
    for name, look in looks(list(table.columns)).items():
        ax.plot(table.index.to_numpy(), 100 * table[name], **look.line)
    ax.set_xlabel("frame")
    ax.set_ylabel("image called road, %")
    ax.set_ylim(bottom=0)
    _legend(figure, list(table.columns))
    return figure


def forest(changes: Sequence[MaskComparison]) -> Figure:
    """Draw each result's changes of rates against the base, with their intervals."""
    figure, grid = _rate_axes(0.8 + 0.26 * len(changes), sharey=True)
    places = np.arange(len(changes))
    for rate, ax in grid.items():
        for place, each in zip(places, changes, strict=True):
            change = each.difference[rate]
            ax.plot(in_percent(change.mean), place, "o", color=INK, markersize=5)
            if change.low is not None and change.high is not None:
                ends = [100 * change.low, 100 * change.high]
                ax.plot(ends, [place, place], color=INK, linewidth=1.6)
        ax.axvline(0, color=FAINT, linewidth=0.8)
        ax.margins(x=0.15)
        low, high = ax.get_xlim()
        ax.set_xlim(min(low, -LEAST), max(high, LEAST))
        ax.set_title(f"{rate}, pp", loc="left")
        ax.grid(axis="x")
        ax.grid(visible=False, axis="y")
    first = next(iter(grid.values()))
    first.set_yticks(places, [_name(each) for each in changes])
    first.set_ylim(len(changes) - 0.5, -0.5)
    return figure


def levels(rows: Sequence[MaskComparison]) -> Figure:
    """Draw the rates of several results' final masks, a line of marks a result."""
    results = list(dict.fromkeys(row.result for row in rows))
    variants = list(dict.fromkeys(row.variant for row in rows))
    figure, grid = _rate_axes(1.0 + 0.32 * len(results), sharey=True)
    for rate, ax in grid.items():
        for variant, look in looks(variants).items():
            own = [row for row in rows if row.variant == variant]
            values = [in_percent(row.new[rate]) for row in own]
            _marks(ax, values, [results.index(row.result) for row in own], look)
        ax.set_title(f"{rate}, %", loc="left")
        if not SHORT[rate].higher_is_better:
            ax.set_xlim(left=0)
        ax.grid(axis="x")
    first = next(iter(grid.values()))
    first.set_yticks(range(len(results)), results)
    first.set_ylim(len(results) - 0.5, -0.5)
    _legend(figure, variants)
    return figure


def _rate_axes(height: float, *, sharey: bool = False) -> tuple[Figure, dict[str, Axes]]:
    """Return a figure with axes for each rate, in rows of ``height`` inches."""
    from matplotlib.figure import Figure

    rows, columns = -(-len(SHORT) // PER_ROW), min(len(SHORT), PER_ROW)
    figure = Figure(figsize=(WIDTH, height * rows), layout="constrained")
    grid = figure.subplots(rows, columns, sharey=sharey, squeeze=False).ravel()
    for spare in grid[len(SHORT) :]:
        spare.remove()
    return figure, dict(zip(SHORT, grid, strict=False))


def _name(row: MaskComparison) -> str:
    same = row.result == row.variant
    return row.result if same else f"{row.result}: {row.variant}"


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


def _legend(figure: Figure, variants: Sequence[str]) -> None:
    """Write above the axes which variant is drawn how."""
    from matplotlib.lines import Line2D

    handles = []
    for name, look in looks(variants).items():
        mark = {} if name == BASELINE else look.mark
        handles.append(Line2D([], [], **look.line, **mark, markersize=5, label=name))
    figure.legend(handles=handles, loc="outside upper left", ncols=6, handlelength=3.2)


def _frame_ticks(ax: Axes, frames: Any) -> None:
    """Label places along the evaluated frames with round numbers of frames."""
    from matplotlib.ticker import MaxNLocator

    wanted = MaxNLocator(nbins=10, integer=True).tick_values(frames[0], frames[-1])
    wanted = wanted[(wanted >= frames[0]) & (wanted <= frames[-1])]
    places = np.unique(np.searchsorted(frames, wanted))
    ax.set_xticks(places, [str(frame) for frame in frames[places]])
    ax.set_xlim(-0.5, len(frames) - 0.5)
    ax.set_xlabel("frame")
