"""The comparison's own figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from roadeval.report.figures.plots import WIDTH, in_percent, legend, marks
from roadeval.report.figures.style import FAINT, INK, looks

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def forest(changes: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw each result's change of ERR, FPR and FNR against the base, with its interval.

    Parameters
    ----------
    changes
        Rows of a comparison with ``result``, ``variant`` and ``difference``.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 0.8 + 0.26 * len(changes)), layout="constrained")
    names = [
        each["result"]
        if each["result"] == each["variant"]
        else f"{each['result']}: {each['variant']}"
        for each in changes
    ]
    places = np.arange(len(changes))
    grid = figure.subplots(1, 3, sharey=True)
    for ax, rate in zip(grid, ("ERR", "FPR", "FNR"), strict=True):
        for place, each in zip(places, changes, strict=True):
            told = each["difference"][rate]
            ax.plot(in_percent(told["mean"]), place, "o", color=INK, markersize=5)
            if told["low"] is not None:
                ends = [100 * told["low"], 100 * told["high"]]
                ax.plot(ends, [place, place], color=INK, linewidth=1.6)
        ax.axvline(0, color=FAINT, linewidth=0.8)
        ax.margins(x=0.15)
        # Rounding alone must not look like a change.
        low, high = ax.get_xlim()
        ax.set_xlim(min(low, -0.1), max(high, 0.1))
        ax.set_title(f"{rate}, pp", loc="left")
        ax.grid(axis="x")
        ax.grid(visible=False, axis="y")
    grid[0].set_yticks(places, names)
    grid[0].set_ylim(len(changes) - 0.5, -0.5)
    return figure


def levels(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the rates of several results' final masks, a line of marks a result.

    Parameters
    ----------
    rows
        Rows of a comparison with ``result``, ``variant`` and ``new``.
    """
    from matplotlib.figure import Figure

    results = list(dict.fromkeys(row["result"] for row in rows))
    variants = list(dict.fromkeys(row["variant"] for row in rows))
    figure = Figure(figsize=(WIDTH, 1.0 + 0.32 * len(results)), layout="constrained")
    grid = figure.subplots(1, 3, sharey=True)
    for ax, rate in zip(grid, ("ERR", "FPR", "FNR"), strict=True):
        for variant, look in looks(variants).items():
            own = [row for row in rows if row["variant"] == variant]
            x = [in_percent(row["new"][rate]) for row in own]
            marks(ax, x, [results.index(row["result"]) for row in own], look)
        ax.set_title(f"{rate}, %", loc="left")
        ax.set_xlim(left=0)
        ax.grid(axis="x")
    grid[0].set_yticks(range(len(results)), results)
    grid[0].set_ylim(len(results) - 0.5, -0.5)
    legend(figure, variants)
    return figure
