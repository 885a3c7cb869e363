"""Further rates over the drive: those of short tables that the paper's figures 3a and 3b lack."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from roadeval.evaluation.metrics import SHORT
from roadeval.report.figures import fig3a_error_rate, fig3b_fp_fn_rate
from roadeval.report.figures.figure import FigureData, FigureSpec
from roadeval.report.figures.rates_over_drive import rates_over_drive
from roadeval.report.figures.values import over_windows

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def further_rates(data: FigureData) -> Figure | None:
    """Draw every further rate of each variant's final mask over the drive."""
    axes = {name: f"{SHORT[name].in_words.capitalize()}\n({name})" for name in _names(data)}
    if not axes:
        return None
    title = f"Further rates on {data.drive}"
    return rates_over_drive(title, data.windows, axes, height=1.9 + 2 * len(axes))


def _names(data: FigureData) -> list[str]:
    drawn = {*fig3a_error_rate.AXES, *fig3b_fp_fn_rate.AXES}
    # In results that were made before a metric was added it is undefined everywhere.
    further = [name for name in SHORT if name not in drawn] if len(data.windows) else []
    return [name for name in further if not np.isnan(data.windows[name]).all()]


FIGURE = FigureSpec(
    "further_rates",
    "Further rates over the drive.",
    further_rates,
    in_report=True,
    charts=lambda data: over_windows(data.windows, _names(data)),
)
