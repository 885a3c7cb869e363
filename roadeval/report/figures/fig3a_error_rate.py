"""Figure 3a of the paper: the error rate over the drive, in rows of ten frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from roadeval.report.figures.figure import FigureData, FigureSpec
from roadeval.report.figures.rates_over_drive import rates_over_drive
from roadeval.report.figures.values import over_windows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AXES: Final = {"ERR": "Error rate (ERR)"}


def error_rate(data: FigureData) -> Figure | None:
    """Draw ERR of each variant's final mask over the drive."""
    return rates_over_drive(f"Error rate on {data.drive}", data.windows, AXES, height=3.9)


FIGURE = FigureSpec(
    "fig3a_error_rate",
    "The paper's figure 3a: error rate.",
    error_rate,
    in_report=True,
    charts=lambda data: over_windows(data.windows, [*AXES]),
)
