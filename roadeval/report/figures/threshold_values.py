"""The numbers of the curves over thresholds, and as charts, in percent."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from roadeval.data import BASELINE
from roadeval.data.words import in_percent
from roadeval.evaluation import scored
from roadeval.evaluation.thresholds import LEVELS, Thresholds
from roadeval.report.chart import Chart, ChartKind, Series
from roadeval.report.figures.figure import FigureData, ThresholdData
from roadeval.report.figures.style import FAINT, Look, looks

LEAST: Final = 50
"""Percent at which axes begin, unless a mask lies lower."""
STEP: Final = 10
"""Percent by which they are widened."""
MOST: Final = 101
"""Percent at which axes end, so that a line along the edge is seen."""
DIAGONAL: Final = "as they say"


@dataclass(frozen=True, slots=True)
class MaskPoint:
    """A final mask at its own threshold, in percent."""

    fpr: float
    tpr: float
    precision: float


@dataclass(frozen=True, slots=True)
class Limits:
    """Where axes begin and end so that every mask is seen: `recall` and `rate` from below."""

    recall: float
    rate: float
    fpr: float


def variants_in(found: ThresholdData) -> dict[str, Look]:
    """Return how each variant is drawn, the baseline last."""
    return looks([*(name for name in found.totals if name != BASELINE), BASELINE])


def masks_in(found: ThresholdData) -> dict[str, MaskPoint]:
    """Return each variant's final mask."""
    finals = {name: [*stages.values()][-1] for name, stages in found.totals.items()}
    return {name: _point(total) for name, total in finals.items()}


def _point(total: Mapping[str, Any]) -> MaskPoint:
    rates = (total["pooled_FPR"], total["pooled_TPR"], scored.overlap(total)["precision"])
    return MaskPoint(*map(in_percent, rates))


def thresholds_in(found: ThresholdData) -> dict[str, Thresholds]:
    """Return the thresholds of each variant that says how probable road is."""
    made = {}
    for variant, _, places in found.levels.masks():
        rows = found.levels.take(places)
        counts = np.zeros((2, LEVELS), np.int64)
        counts[:, rows["level"]] = rows["other"], rows["road"]
        made[variant] = Thresholds.of(counts)
    return made


def limits_of(masks: Mapping[str, MaskPoint]) -> Limits:
    """Return the limits within which masks lie."""
    recall = _below([mask.tpr for mask in masks.values()])
    rate = _below([mask.precision for mask in masks.values()])
    known = [mask.fpr for mask in masks.values() if math.isfinite(mask.fpr)]
    return Limits(recall, rate, math.ceil(max([*known, STEP]) / STEP) * STEP)


def _below(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return min(math.floor(min([*known, LEAST]) / STEP) * STEP, LEAST)


def curve_charts(data: FigureData) -> list[Chart]:
    """Return precision over recall, the ROC, and reliability; none without a probability."""
    found = data.thresholds
    if found is None or not len(found.levels):
        return []
    drawn, masks, curves = variants_in(found), masks_in(found), thresholds_in(found)
    limits = limits_of(masks)
    recall, roc = [], []
    for name, each in curves.items():
        recall.append(_series(name, drawn[name], each.recall, each.precision))
        # From the threshold that nothing reaches.
        ends = (np.concatenate([[0.0], rates]) for rates in (each.fpr, each.recall))
        roc.append(_series(name, drawn[name], *ends))
    for name, mask in masks.items():
        title, look = f"{name}: the mask", drawn[name]
        recall.append(_mark(title, look, mask.tpr, mask.precision))
        roc.append(_mark(title, look, mask.fpr, mask.tpr))
    lines, top = ChartKind.LINES, float(MOST)
    across, up = (limits.recall, top), (limits.rate, top)
    return [
        Chart("precision", lines, recall, across="recall", x_range=across, y_range=up),
        Chart(
            *("TPR, which is recall", lines, roc),
            across="FPR",
            x_range=(-0.01 * limits.fpr, limits.fpr),
            y_range=across,
        ),
        Chart(
            *("road among the pixels", lines, _reliability(found, drawn)),
            across="probability",
            x_range=(-1.0, top),
            y_range=(-1.0, top),
        ),
    ]


def _reliability(found: ThresholdData, drawn: Mapping[str, Look]) -> list[Series]:
    ideal = Series(DIAGONAL, FAINT, [0.0, 100.0], [0.0, 100.0], dashed=True)
    return [ideal] + [
        _series(variant, drawn[variant], *([b[n] for b in own["bins"]] for n in _AXES))
        for variant, stages in found.quoted.items()
        for own in stages.values()
    ]


_AXES: Final = ("probability", "road")


def _series(name: str, look: Look, x: Any, y: Any) -> Series:
    across, up = (100 * np.asarray(each, float) for each in (x, y))
    known = np.isfinite(across)
    return Series(name, look.colour, across[known].tolist(), up[known].tolist(), dashed=look.hollow)


def _mark(name: str, look: Look, x: float, y: float) -> Series:
    there = math.isfinite(x) and math.isfinite(y)
    return Series(name, look.colour, [x] * there, [y] * there, hollow=look.hollow)
