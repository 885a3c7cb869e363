"""Curves over thresholds: precision and recall, ROC, and reliability."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE
from roadeval.evaluation import scored
from roadeval.evaluation.thresholds import LEVELS, Thresholds
from roadeval.report.figures.figure import FigureData, FigureSpec, ThresholdData
from roadeval.report.figures.style import FAINT, Look, heading, looks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST: Final = 50
"""Percent at which axes begin, unless a mask lies lower."""
STEP: Final = 10
"""Percent by which they are widened."""


def curves(data: FigureData) -> Figure | None:
    """Draw the curves of every variant that says how probable road is, and the other masks."""
    from matplotlib.figure import Figure

    found = data.thresholds
    if found is None or found.levels.empty:
        return None
    figure = Figure(figsize=(8, 3.7))
    heading(figure, f"Over thresholds on {data.drive}", "Marks: the masks at their own thresholds")
    axes = figure.subplots(1, 3)
    names = [name for name in found.totals if name != BASELINE]
    drawn = looks([*names, BASELINE])
    for (variant, _), thresholds in _thresholds(found).items():
        look = drawn[variant]
        axes[0].plot(100 * thresholds.recall, 100 * thresholds.precision, **look.line)
        axes[1].plot(*_from_zero(thresholds), **look.line)
    for name, stages in found.totals.items():
        _mark(axes[0], axes[1], [*stages.values()][-1], drawn[name])
    for variant, stages in found.quoted.items():
        for own in stages.values():
            _reliability(axes[2], own["bins"], drawn[variant])
    _frame(axes)
    figure.legend(ncols=4, loc="lower center", frameon=False)
    figure.subplots_adjust(left=0.07, right=0.985, top=0.84, bottom=0.3, wspace=0.32)
    return figure


FIGURE = FigureSpec(
    "thresholds",
    "Precision and recall, ROC and reliability over thresholds. A curve belongs to a variant that "
    "says how probable road is; a mark is a mask at its own threshold. Axes begin where the masks "
    "lie. Reliability: the share of road among pixels of about the same probability; on the "
    "diagonal probabilities are what they say, and larger marks stand for more pixels.",
    curves,
)


def _thresholds(found: ThresholdData) -> dict[tuple[str, str], Thresholds]:
    made = {}
    for (variant, stage), rows in found.levels.groupby(["variant", "stage"], sort=False):
        counts = np.zeros((2, LEVELS), np.int64)
        counts[:, rows["level"]] = rows[["other", "road"]].to_numpy().T
        made[str(variant), str(stage)] = Thresholds.of(counts)
    return made


def _from_zero(thresholds: Thresholds) -> tuple[Any, Any]:
    """Return FPR and TPR in percent, from the threshold that nothing reaches."""
    rates = (thresholds.fpr, thresholds.recall)
    fpr, tpr = (100 * np.concatenate([[0.0], each]) for each in rates)
    return fpr, tpr


def _mark(left: Axes, middle: Axes, total: Mapping[str, Any], look: Look) -> None:
    precision = scored.overlap(total)["precision"]
    style = {**look.mark, "color": look.colour, "linestyle": "none", "zorder": 5}
    left.plot(100 * total["pooled_TPR"], 100 * precision, **style, label=look.label)
    middle.plot(100 * total["pooled_FPR"], 100 * total["pooled_TPR"], **style)


def _reliability(ax: Axes, bins: Any, look: Look) -> None:
    x, y = ([100 * each[name] for each in bins] for name in ("probability", "road"))
    pixels = np.array([each["pixels"] for each in bins], float)
    ax.plot(x, y, **look.line)
    ax.scatter(x, y, 4 + 90 * pixels / pixels.sum(), color=look.colour, zorder=4)


def _frame(axes: Any) -> None:
    """Title the axes, and begin them where the masks lie."""
    titles = (("recall, %", "precision, %"), ("FPR, %", "TPR, %"), ("probability, %", "road, %"))
    for ax, (x, y) in zip(axes, titles, strict=True):
        ax.set(xlabel=x, ylabel=y)
        ax.grid(visible=True, axis="both")
    marks = [line.get_xydata()[0] for line in axes[0].lines if len(line.get_xydata()) == 1]
    low = np.minimum(np.floor(np.nanmin([*marks, [LEAST, LEAST]], axis=0) / STEP) * STEP, LEAST)
    axes[0].set(xlim=(low[0], 101), ylim=(low[1], 101))
    fprs = [line.get_xdata()[0] for line in axes[1].lines if len(line.get_xdata()) == 1]
    high = np.ceil(np.nanmax([*fprs, STEP]) / STEP) * STEP
    axes[1].set(xlim=(-0.01 * high, high), ylim=(low[0], 101))
    axes[2].plot([0, 100], [0, 100], color=FAINT, linewidth=0.8, linestyle=(0, (2, 2)))
    axes[2].set(xlim=(-1, 101), ylim=(-1, 101))
