"""Figure 3b of the paper: both kinds of error over the drive, in rows of ten frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from roadeval.report.figures.figure import FigureData, FigureSpec
from roadeval.report.figures.rates_over_drive import rates_over_drive
from roadeval.report.figures.values import over_windows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AXES: Final = {
    "FPR": "False positives (FPR)\nnon-road called road",
    "FNR": "False negatives (FNR)\nroad not found",
}


def fp_fn_rate(data: FigureData) -> Figure | None:
    """Draw FPR and FNR of each variant's final mask over the drive."""
    title = f"False positive and false negative rate on {data.drive}"
    return rates_over_drive(title, data.windows, AXES, height=5.9)


FIGURE = FigureSpec(
    "fig3b_fp_fn_rate",
    "The paper's figure 3b: false positive and false negative error rates.",
    fp_fn_rate,
    in_report=True,
    charts=lambda data: over_windows(data.windows, [*AXES]),
)
