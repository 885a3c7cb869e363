"""Curves over thresholds: precision and recall, ROC, and reliability."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.report.figures.figure import FigureData, FigureSpec
from roadeval.report.figures.layout import INCH
from roadeval.report.figures.legend import ROW, LegendStyle, room_in
from roadeval.report.figures.style import FAINT, Look, heading
from roadeval.report.figures.threshold_values import (
    MOST,
    MaskPoint,
    curve_charts,
    limits_of,
    masks_in,
    thresholds_in,
    variants_in,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH: Final = 8
HEIGHT: Final = 3.7
"""Inches across the figure and from its top to its bottom, with `LINES` of a legend at most."""
ABOVE: Final = 0.16 * HEIGHT
HIGH: Final = 0.54 * HEIGHT
"""Inches above the axes, and from their top to their bottom."""
LINES: Final = 3
LEGEND: Final = LegendStyle(columns=4, handlelength=2.0)
ROOM: Final = room_in(WIDTH)


def curves(data: FigureData) -> Figure | None:
    """Draw the curves of every variant that says how probable road is, and the other masks."""
    from matplotlib.figure import Figure

    found = data.thresholds
    if found is None or not len(found.levels):
        return None
    drawn, masks = variants_in(found), masks_in(found)
    labels = LEGEND.short([drawn[name].label for name in masks], ROOM)
    height = HEIGHT + ROW / INCH * max(LEGEND.lines(labels, ROOM) - LINES, 0)
    figure = Figure(figsize=(WIDTH, height))
    heading(figure, f"Over thresholds on {data.drive}", "Marks: the masks at their own thresholds")
    axes = figure.subplots(1, 3)
    for variant, thresholds in thresholds_in(found).items():
        look = drawn[variant]
        axes[0].plot(100 * thresholds.recall, 100 * thresholds.precision, **look.line)
        # From the threshold that nothing reaches.
        ends = (np.concatenate([[0.0], each]) for each in (thresholds.fpr, thresholds.recall))
        axes[1].plot(*(100 * each for each in ends), **look.line)
    for name, mask in masks.items():
        _mark(axes[0], axes[1], mask, drawn[name])
    for variant, stages in found.quoted.items():
        for own in stages.values():
            _reliability(axes[2], own["bins"], drawn[variant])
    _frame(axes, masks)
    handles, _ = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", **LEGEND.arguments(labels, ROOM))
    top, bottom = 1 - ABOVE / height, 1 - (ABOVE + HIGH) / height
    figure.subplots_adjust(left=0.07, right=0.985, top=top, bottom=bottom, wspace=0.32)
    return figure


FIGURE = FigureSpec(
    "thresholds",
    "Precision and recall, ROC and reliability over thresholds. A curve belongs to a variant that "
    "says how probable road is; a mark is a mask at its own threshold. Axes begin where the masks "
    "lie. Reliability: the share of road among pixels of about the same probability; on the "
    "diagonal probabilities are what they say, and larger marks stand for more pixels.",
    curves,
    charts=curve_charts,
)


def _mark(left: Axes, middle: Axes, mask: MaskPoint, look: Look) -> None:
    style = {**look.mark, "color": look.colour, "linestyle": "none", "zorder": 5}
    left.plot(mask.tpr, mask.precision, **style, label=look.label)
    middle.plot(mask.fpr, mask.tpr, **style)


def _reliability(ax: Axes, bins: Any, look: Look) -> None:
    x, y = ([100 * each[name] for each in bins] for name in ("probability", "road"))
    pixels = np.array([each["pixels"] for each in bins], float)
    ax.plot(x, y, **look.line)
    ax.scatter(x, y, 4 + 90 * pixels / pixels.sum(), color=look.colour, zorder=4)


def _frame(axes: Any, masks: dict[str, MaskPoint]) -> None:
    """Title the axes, and begin them where the masks lie."""
    titles = (("recall, %", "precision, %"), ("FPR, %", "TPR, %"), ("probability, %", "road, %"))
    for ax, (x, y) in zip(axes, titles, strict=True):
        ax.set(xlabel=x, ylabel=y)
        ax.grid(visible=True, axis="both")
    limits = limits_of(masks)
    axes[0].set(xlim=(limits.recall, MOST), ylim=(limits.rate, MOST))
    # What is recall below the one on the left is so beside this one, too.
    axes[1].set(xlim=(-0.01 * limits.fpr, limits.fpr), ylim=(limits.recall, MOST))
    axes[2].plot([0, 100], [0, 100], color=FAINT, linewidth=0.8, linestyle=(0, (2, 2)))
    axes[2].set(xlim=(-1, MOST), ylim=(-1, MOST))
