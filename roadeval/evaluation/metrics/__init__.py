"""The metrics, one file each: the paper's six (Eq. 24-29) and those a reader of today expects.

To add one, add a file with a ``METRIC``: it becomes a column of the tables and a series of the
recording.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Counts
from roadeval.evaluation.metric import Metric
from roadeval.runtime.discovery import by_name, found_in

ALL: Final[Mapping[str, Metric]] = by_name(
    sorted(
        found_in(sys.modules[__name__], "METRIC"), key=lambda metric: (metric.order, metric.name)
    )
)
METRICS: Final = {name: metric for name, metric in ALL.items() if metric.tabled}
"""The columns of the tables, in their order."""
OVERLAP: Final = {name: metric for name, metric in ALL.items() if not metric.tabled}
"""Metrics beyond the paper's, which are computed of sums alone."""


def of(counts: Counts) -> dict[str, float]:
    """Compute the tabled metrics of a mask's counts."""
    return {name: metric.function(counts) for name, metric in METRICS.items()}


def overlap(counts: Counts) -> dict[str, float]:
    """Compute the metrics that stand in no table."""
    return {name: metric.function(counts) for name, metric in OVERLAP.items()}


def table(counts: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """Compute the tabled metrics of many frames at once, exactly as `of` does.

    Parameters
    ----------
    counts
        ``(n, 4)``: TP, TN, FP, FN.

    Returns
    -------
    array
        ``(n, m)`` float64 in the order of `METRICS`; NaN where a metric is undefined.
    """
    columns = Counts(*counts.T)
    with np.errstate(invalid="ignore"):
        return np.stack([metric.function(columns) for metric in METRICS.values()], axis=1)
