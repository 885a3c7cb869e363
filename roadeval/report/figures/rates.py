"""Figures 3a and 3b of the paper: rates over the drive in rows of ten frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import FINAL_STAGE
from roadeval.report.figures.style import Look, heading, looks

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES: Final = {
    "ERR": "Error rate (ERR)",
    "FPR": "False positives (FPR)\nnon-road called road",
    "FNR": "False negatives (FNR)\nroad not found",
}
CROWDED: Final = 150
"""More windows than this are drawn as means of several, with their range as a band."""
MARKED: Final = 25
"""Up to this many points each bears its marker; beyond, about as many do."""
PER_LINE: Final = 3
"""Entries of the legend in a line."""
Values = npt.NDArray[np.float64]


def error_rate(drive: str, windows: pd.DataFrame) -> Figure:
    """Draw figure 3a: ERR of each variant's final mask over the drive.

    Parameters
    ----------
    drive
        Stands in the title.
    windows
        As ``windows.csv``; at least one row.
    """
    return _figure(f"Error rate on {drive}", windows, ("ERR",), height=3.9)


def fp_fn_rate(drive: str, windows: pd.DataFrame) -> Figure:
    """Draw figure 3b: FPR and FNR of each variant's final mask over the drive.

    The parameters are those of `error_rate`.
    """
    return _figure(
        f"False positive and false negative rate on {drive}", windows, ("FPR", "FNR"), height=5.9
    )


def _figure(title: str, windows: pd.DataFrame, rates: Sequence[str], height: float) -> Figure:
    from matplotlib.figure import Figure

    final = _final_masks(windows)
    rows = final.drop_duplicates("window").sort_values("window")
    group = -(-len(rows) // CROWDED)
    figure = Figure(figsize=(8, height))
    heading(figure, title, _subtitle(final, rows, group))
    axes = figure.subplots(len(rates), 1, sharex=True, squeeze=False)[:, 0]
    for ax, rate in zip(axes, rates, strict=True):
        _draw(ax, final, rate, group)
    _label_rows(axes[-1], rows)
    lines = _legend(figure, axes[0])
    top = 1 - (0.66 + 0.2 * lines) / height
    figure.subplots_adjust(left=0.11, right=0.985, bottom=0.55 / height, top=top, hspace=0.13)
    figure.align_ylabels(axes)
    return figure


def _final_masks(windows: pd.DataFrame) -> pd.DataFrame:
    """Keep each variant's final stage: ``post``, or the last that it has."""
    last = windows.groupby("variant", sort=False)["stage"].agg(
        lambda stages: FINAL_STAGE if FINAL_STAGE in set(stages) else stages.iloc[-1]
    )
    return windows[windows["stage"] == windows["variant"].map(last)]


def _subtitle(final: pd.DataFrame, rows: pd.DataFrame, group: int) -> str:
    stages, size = ", ".join(dict.fromkeys(final["stage"])), rows["frames"].max()
    each = f"each point is the mean of {size} frames" if size > 1 else "each point is one frame"
    if group > 1:
        each = f"each point averages {group} rows of {size} frames, the band spans them"
    return f"Final mask ({stages}); {each}; lower is better"


def _draw(ax: Axes, final: pd.DataFrame, rate: str, group: int) -> None:
    from matplotlib.ticker import MaxNLocator, StrMethodFormatter

    for name, look in looks(list(dict.fromkeys(final["variant"]))).items():
        own = final[final["variant"] == name].sort_values("window")
        _line(ax, own["window"].to_numpy(float), 100 * own[rate].to_numpy(float), look, group)
    percent = 100 * final[rate].to_numpy(float)
    if np.isnan(percent).all():
        ax.text(0.5, 0.5, "undefined on every frame", transform=ax.transAxes, ha="center")
    ax.set_ylim(0, max(1.08 * np.nanmax([*percent, 0.1]), 0.5))
    ax.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
    ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g} %"))
    ax.set_ylabel(NAMES[rate])


def _line(ax: Axes, x: Values, y: Values, look: Look, group: int) -> None:
    """Draw a variant's series; where the rows are too many to be told apart, mean and range."""
    if group > 1:
        starts = np.arange(0, len(x), group)
        low, high = np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)
        x, y = _means(x, starts), _means(y, starts)
        ax.fill_between(x, low, high, color=look.colour, alpha=0.15, linewidth=0)
    ax.plot(
        x,
        y,
        label=look.label,
        color=look.colour,
        linestyle=look.dash,
        linewidth=look.width,
        marker=look.marker,
        markersize=5,
        markerfacecolor="white" if look.hollow else look.colour,
        markevery=-(-len(x) // MARKED),
        zorder=look.order,
        clip_on=False,
    )


def _means(values: Values, starts: npt.NDArray[np.intp]) -> Values:
    """Average each group of values, an undefined one left out."""
    known = ~np.isnan(values)
    sums = np.add.reduceat(np.where(known, values, 0.0), starts)
    counts = np.add.reduceat(known.astype(float), starts)
    average: Values = np.divide(sums, counts, out=np.full(len(sums), np.nan), where=counts > 0)
    return average


def _label_rows(ax: Axes, rows: pd.DataFrame) -> None:
    """Write below which frames the rows hold; where there is no room for that, where some begin."""
    first, last = rows["first_frame"].astype(str), rows["last_frame"].astype(str)
    spans = first.where(first == last, first + "\N{EN DASH}" + last)
    roomy = _step(spans) == 1
    labels = spans if roomy else first
    every = _step(labels)
    numbers = rows["window"].to_numpy()
    ax.set_xticks(numbers[::every], labels.tolist()[::every])
    margin = 0.5 if len(rows) < CROWDED else 0.005 * len(rows)
    ax.set_xlim(numbers[0] - margin, numbers[-1] + margin)
    size, rest = rows["frames"].max(), rows["frames"].iloc[-1]
    what = f"Evaluated frames, {size} a row" if roomy else f"First frame of each row of {size}"
    short = f"; the last row holds {rest}" if rest != size else ""
    ax.set_xlabel(what + short)


def _step(labels: pd.Series[str]) -> int:
    """Find how many labels to go on so that no two touch, at 7 inches of axis and 8 points."""
    room = max(int(7 / (0.075 * labels.str.len().max() + 0.12)), 1)
    return -(-len(labels) // room)


def _legend(figure: Figure, ax: Axes) -> int:
    """Write the legend above the axes, where it covers nothing; return its number of lines."""
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="upper left",
        bbox_to_anchor=(0.0, 1 - 0.5 / figure.get_figheight()),
        ncols=PER_LINE,
        handlelength=3.4,
        columnspacing=2.0,
    )
    return -(-len(labels) // PER_LINE)
