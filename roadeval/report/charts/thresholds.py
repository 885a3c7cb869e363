"""Charts over thresholds: precision and recall, ROC, and reliability."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from roadeval.data import BASELINE, Rows
from roadeval.data.words import in_percent
from roadeval.evaluation import score
from roadeval.evaluation.score import LEVELS, Thresholds
from roadeval.report.chart import FAINT, Chart, ChartKind, Look, Series, looks

LEAST: Final = 50
"""Percent at which axes begin, unless a mask lies lower."""
STEP: Final = 10
"""Percent by which they are widened."""
MOST: Final = 101.0
"""Percent at which axes end, so that a line along the edge is seen."""
CAPTION: Final = (
    "Precision over recall, ROC, and reliability: the share of road among pixels of about the same "
    "probability, beside the diagonal on which it is what the probability says. A curve belongs to "
    "a variant that says how probable road is; a mark is a mask at its own threshold. Axes begin "
    "where the masks lie."
)

Masks = Mapping[str, Mapping[str, Mapping[str, Any]]]


def curves(levels: Rows, quoted: Masks, totals: Masks) -> list[Chart]:
    """Return precision over recall, the ROC, and reliability; none without a probability.

    Parameters
    ----------
    levels
        As ``probabilities.csv``.
    quoted, totals
        As ``curves`` and ``totals`` in ``summary.json``: of every variant.
    """
    if not len(levels):
        return []
    drawn = looks([*(name for name in totals if name != BASELINE), BASELINE])
    recall, roc = [], []
    for name, each in _thresholds(levels).items():
        recall.append(_curve(name, drawn[name], each.recall, each.precision))
        # From the threshold that nothing reaches.
        ends = (np.concatenate([[0.0], rates]) for rates in (each.fpr, each.recall))
        roc.append(_curve(name, drawn[name], *ends))
    masks = {name: _mask([*totals[name].values()][-1]) for name in drawn if name in totals}
    for name, (fpr, tpr, precision) in masks.items():
        recall.append(_mark(f"{name}: the mask", drawn[name], tpr, precision))
        roc.append(_mark(f"{name}: the mask", drawn[name], fpr, tpr))
    bins = [
        _curve(name, drawn[name], *([b[key] for b in own["bins"]] for key in _AXES))
        for name, stages in quoted.items()
        for own in stages.values()
    ]
    ideal = Series("as probabilities say", Look(FAINT, "dotted"), [0.0, 100.0], [0.0, 100.0])
    fprs, tprs, precisions = zip(*masks.values(), strict=True)
    # What is recall below the first chart is so beside the second, too.
    across, up = (_below(tprs), MOST), (_below(precisions), MOST)
    most = math.ceil(max([*filter(math.isfinite, fprs), STEP]) / STEP) * float(STEP)
    lines, whole = ChartKind.LINES, (-1.0, MOST)
    return [
        Chart("precision", lines, recall, across="recall", x_range=across, y_range=up),
        Chart("TPR", lines, roc, across="FPR", x_range=(-0.01 * most, most), y_range=across),
        Chart(
            *("share of road", lines, [*bins, ideal]),
            across="probability",
            x_range=whole,
            y_range=whole,
        ),
    ]


_AXES: Final = ("probability", "road")


def _thresholds(levels: Rows) -> dict[str, Thresholds]:
    """Return the thresholds of each variant that says how probable road is."""
    made = {}
    for variant, _, places in levels.masks():
        rows = levels.take(places)
        counts = np.zeros((2, LEVELS), np.int64)
        counts[:, rows["level"]] = rows["other"], rows["road"]
        made[variant] = Thresholds.of(counts)
    return made


def _mask(total: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return FPR, TPR and precision of a mask, in percent."""
    precision = score.overlap(total)["precision"]
    return in_percent(total["pooled_FPR"]), in_percent(total["pooled_TPR"]), in_percent(precision)


def _below(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return float(min(math.floor(min([*known, LEAST]) / STEP) * STEP, LEAST))


def _curve(name: str, look: Look, x: Any, y: Any) -> Series:
    across, up = (100 * np.asarray(each, float) for each in (x, y))
    known = np.isfinite(across)
    return Series(name, look, across[known].tolist(), up[known].tolist())


def _mark(name: str, look: Look, x: float, y: float) -> Series:
    there = math.isfinite(x) and math.isfinite(y)
    return Series(name, look, [x] * there, [y] * there)
