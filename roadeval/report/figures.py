"""The paper's figures 2, 3a and 3b as files: blocks of a report, each on a page of its own size.

Equal figures give equal files, byte for byte.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

from roadeval.data import BASELINE, FILTERED, IGNORE, UNFILTERED, as_plain
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.tables import finals, values_of
from roadeval.report.blocks import Figure, Report
from roadeval.report.chart import Chart, thin
from roadeval.report.charts.standard import over_windows
from roadeval.report.images import ExampleFrame, example_grid
from roadeval.report.pdf.typeset import typeset
from roadeval.runtime.text import elided

if TYPE_CHECKING:
    import pandas as pd

PIXELS_PER_INCH: Final = 230
"""Resolution of the PNG files: some 1600 pixels across."""
CROWDED: Final = 150
"""More windows than this are drawn as means of neighbours."""
_LABELS: Final = {
    FILTERED: "filtered: with the shadow filter",
    UNFILTERED: "unfiltered: without it",
    BASELINE: "blind: never looks at the image",
}
_LONGEST: Final = 80
"""Letters of a variant's name that fit in a line."""


def write_figures(
    folder: Path,
    drive: str,
    windows: pd.DataFrame,
    examples: Sequence[ExampleFrame],
    camera: str = "",
) -> list[Path]:
    """Write every figure that has something to draw as PNG and PDF; return the files.

    The folder is made if it is not there. ``windows`` are as in ``windows.csv``, of any number of
    variants, without a row where there is no truth; ``examples`` are a few frames, for figure 2;
    ``camera`` is the name of a camera of a rig, for titles and the files' names. An
    OSError if the folder cannot be written to; a `ReportError` if the system's folder for temporary
    files cannot be.
    """
    folder.mkdir(parents=True, exist_ok=True)
    drive = f"{drive}, {camera}" if camera else drive
    ending = f"-{as_plain(camera)}" if camera else ""
    figures = {"fig2_masks": road_masks(drive, examples)} if examples else {}
    if len(windows):
        figures["fig3a_error_rate"] = error_rate(drive, windows)
        figures["fig3b_fp_fn_rate"] = fp_fn_rate(drive, windows)
    kinds: tuple[Literal["png", "pdf"], ...] = ("png", "pdf")
    files = {(name, kind): folder / f"{name}{ending}.{kind}" for name in figures for kind in kinds}
    for (name, kind), path in files.items():
        path.write_bytes(typeset(figures[name], kind, PIXELS_PER_INCH))
    return [*files.values()]


def road_masks(drive: str, examples: Sequence[ExampleFrame]) -> Report:
    """Return figure 2 of the paper: the image, and over it each variant's mask, and the truth."""
    ignored = any(e.truth is not None and (e.truth == IGNORE).any() for e in examples)
    names = {name for example in examples for name in example.masks}
    missing = any(names - example.masks.keys() for example in examples)
    legend = (
        "Green: road"
        + "; grey: ignored, counted nowhere" * ignored
        + "; faded: there is no mask of this frame" * missing
    )
    grid = example_grid([example.small() for example in examples], finest=True)
    return Report(f"Road masks on {drive}", legend, [grid])


def error_rate(drive: str, windows: pd.DataFrame) -> Report:
    """Return figure 3a of the paper: the error rate over the drive, in rows of ten frames."""
    return _over_drive(f"Error rate on {drive}", windows, [TESTED])


def fp_fn_rate(drive: str, windows: pd.DataFrame) -> Report:
    """Return figure 3b of the paper: both kinds of error over the drive, in rows of ten frames."""
    title = f"False positive and false negative rate on {drive}"
    return _over_drive(title, windows, ["FPR", "FNR"])


def _over_drive(title: str, windows: pd.DataFrame, rates: Sequence[str]) -> Report:
    """Return a chart a rate of each variant's final mask, one below the other."""
    stages = ", ".join(values_of(finals(windows), "stage"))
    size, rows = windows["frames"].max(), -(-windows["window"].nunique() // CROWDED)
    point = f"{rows} rows of {size} frames" if rows > 1 else f"{size} frames"
    subtitle = f"Final mask ({stages}); each point is the mean of {point}; lower is better"
    charts = [_for_paper(chart) for chart in over_windows(windows, rates)]
    return Report(title, subtitle, [Figure(charts, "")])


def _for_paper(chart: Chart) -> Chart:
    """Return a chart with few points, whose legend says what the usual variants are."""
    named = [
        replace(series, name=elided(_LABELS.get(series.name, series.name), _LONGEST))
        for series in chart.series
    ]
    few = [thin(series, CROWDED) for series in named]
    return replace(chart, series=few, spaced_marks=True)
