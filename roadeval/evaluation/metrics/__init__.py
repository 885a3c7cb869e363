"""The metrics.

To add metrics, add a file with ``METRICS``. Screens, graphs and reports then show them as their
attributes say; those with ``tabled`` are also columns of the tables and series of the recording.
Another package adds one by an entry point of the group ``roadeval.metrics``; it is never tabled, so
results have the same columns everywhere.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from itertools import chain
from typing import Final

import numpy as np

from roadeval.data import Counts
from roadeval.data.arrays import Floats, Sums
from roadeval.errors import RoadevalError
from roadeval.evaluation.metric import Metric, Shown
from roadeval.runtime.discovery import by_name, collect, installed

_BUILT_IN: Final[Mapping[str, Metric]] = by_name(chain(*collect(sys.modules[__name__], "METRICS")))
_OTHERS: Final = installed("metrics", Metric, RoadevalError, _BUILT_IN)
ALL: Final[Mapping[str, Metric]] = by_name(
    sorted(
        [*_BUILT_IN.values(), *(replace(metric, tabled=False) for metric in _OTHERS)],
        key=lambda metric: (metric.order, metric.name),
    )
)
METRICS: Final = {name: metric for name, metric in ALL.items() if metric.tabled}
"""The columns of the tables, in their order."""
TESTED: Final = "ERR"
"""The rate that is tested. Its differences between final masks and one base are a family, corrected
for their number; other rates and stages only explain them."""
UNTABLED: Final = {name: metric for name, metric in ALL.items() if not metric.tabled}
"""Metrics that are in the totals only: the paper does not have them."""


def _shown(metrics: Mapping[str, Metric], least: Shown) -> dict[str, Metric]:
    """Return the metrics that people see in a place, in the order in which they read them."""
    ranked = sorted(metrics.values(), key=lambda metric: metric.rank)
    return {metric.name: metric for metric in ranked if metric.shown >= least}


SHORT: Final = _shown(METRICS, Shown.EVERYWHERE)
"""The rates of short tables, lists, graphs and charts."""
FULL: Final = _shown(METRICS, Shown.IN_FULL)
"""The rates of tables that show all rates of a mask."""
SHORT_UNTABLED: Final = _shown(UNTABLED, Shown.EVERYWHERE)
"""The metrics of `UNTABLED` that are shown beside `SHORT`."""
COMPARED: Final = tuple(name for name in METRICS if name in FULL)
"""The metrics that have paired differences, in the order of the columns."""


def of(counts: Counts) -> dict[str, float]:
    """Compute the tabled metrics of a mask's counts."""
    return {name: metric.function(counts) for name, metric in METRICS.items()}


def table(counts: Sums, metrics: Mapping[str, Metric] = METRICS) -> Floats:
    """Compute metrics of many frames at once, exactly as `of` does: ``(n, m)`` float64.

    ``counts`` are ``(n, 4)``: TP, TN, FP, FN. Columns are in the order of ``metrics``; NaN if a
    metric is undefined.
    """
    columns = Counts(*counts.T)
    with np.errstate(invalid="ignore"):
        return np.stack([metric.function(columns) for metric in metrics.values()], axis=1)
