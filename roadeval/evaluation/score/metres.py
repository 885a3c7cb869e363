"""Measures in metres summed up over a drive, and how far a wrong camera would move them."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from roadeval.data import CODES, FrameMetres
from roadeval.data.arrays import Bits, Floats, Sums, TruthBits
from roadeval.evaluation.metres import ABOVE, FREE, LEFT, Survey
from roadeval.evaluation.score.counts import count
from roadeval.evaluation.score.thresholds import Curves

LEVELS: Final = 256
"""Thresholds of KITTI's road benchmark, whose confidences have eight bits."""
RECALLS: Final = np.linspace(0, 1, 11)
CENTIMETRES: Final = 100


@dataclass(frozen=True, slots=True)
class Measured:
    """A measure of a drive's final masks, in metres, or a rate over a part of the ground."""

    variant: str
    measure: str
    where: str
    """As ``10m``, ``ahead``, ``0-10m`` or ``from_above``."""
    frames: int
    """Frames on which the truth has it."""
    missing: int
    """Of these, frames on which the mask has not."""
    value: float
    """The median of mask minus truth, positive where the mask reaches too far; or a rate."""
    p95: float
    """The 95th percentile of the size of the difference; NaN of a rate."""
    low: float
    high: float
    """The least and the greatest value as the camera might stand; NaN where that is not known."""


def measure(survey: Survey, masks: Mapping[str, Bits], truth: TruthBits) -> dict[str, FrameMetres]:
    """Measure masks against the truth, ``(H, words)`` each, by name.

    Of their regions the last is the ground seen from above.
    """
    bits = np.array([*masks.values()], np.uint64)
    inside = [band for bands in survey.bands for band in bands.values()]
    counts = count(bits, truth, inside)[:, 1:].reshape(len(bits), len(survey.bands), -1, 4)
    counts = np.concatenate([counts, survey.from_above(bits, truth)[:, :, None]], axis=2)
    ends, regions = survey.ends(bits, truth), (*survey.bands[0], ABOVE)
    return {
        name: FrameMetres(survey.measures, ends[place], regions, counts[place])
        for place, name in enumerate(masks)
    }


class MetreSums:
    """Sums up the measures of final masks, by variant."""

    def __init__(self) -> None:
        self._differences: Final[defaultdict[tuple[str, str, int], list[Counter[int]]]] = (
            defaultdict(list)
        )
        """By variant, measure and place: for each stance how often each difference, in cm."""
        self._seen: Final[Counter[tuple[str, str, int]]] = Counter()
        self._rates: Final[dict[str, Floats]] = {}
        """``(S, R, 2)``: sums of the frames' ERR, and frames that have one."""
        self._above: Final[dict[str, Sums]] = {}
        self._regions: tuple[str, ...] = ()

    def add(self, metres: Mapping[str, FrameMetres]) -> None:
        """Add a frame's measures."""
        for variant, own in metres.items():
            self._regions = tuple(own.regions)
            differences = differences_of(own)
            for place, (measure, at) in enumerate(own.measures):
                name = variant, measure, at
                self._seen[name] += not math.isnan(own.ends[0, place, 1])
                counters = self._differences[name]
                counters += [Counter() for _ in range(len(differences) - len(counters))]
                for counter, metre in zip(counters, differences[:, place].tolist(), strict=False):
                    if not math.isnan(metre):
                        counter[round(metre * CENTIMETRES)] += 1
            labelled = own.counts.sum(axis=2)
            wrong = own.counts[..., 2:].sum(axis=2)
            known = labelled > 0
            shares = np.divide(wrong, labelled, out=np.zeros(wrong.shape), where=known)
            sums = np.stack([shares, known], axis=2)
            if self._rates.setdefault(variant, np.zeros(sums.shape)).shape == sums.shape:
                self._rates[variant] += sums
            above = own.counts[0, self._regions.index(ABOVE)]
            self._above[variant] = above + self._above.get(variant, 0)

    def totals(self, curves: Curves) -> Iterator[Measured]:
        """Yield the measures, variant by variant.

        ``curves`` are of the ground seen from above: where a final mask is a threshold on how
        probable road is, they give MaxF and AP.
        """
        for variant, sums in self._rates.items():
            for place, region in enumerate(self._regions):
                with np.errstate(invalid="ignore"):
                    value, low, high = _ranged(sums[:, place, 0] / sums[:, place, 1])
                frames = int(sums[0, place, 1])
                yield Measured(variant, "ERR", region, frames, 0, value, math.nan, low, high)
            for name, value in kitti(self._above[variant], _final(curves, variant)).items():
                yield Measured(variant, name, ABOVE, 0, 0, value, *(math.nan,) * 3)
            for (own, measured, at), counters in self._differences.items():
                if own == variant:
                    sizes = Counter[int]()
                    for size, count in counters[0].items():
                        sizes[abs(size)] += count
                    frames = self._seen[own, measured, at]
                    value, low, high = _ranged(np.array([quantile(e, 0.5) for e in counters]))
                    where, missing = f"{at}m" if at else "ahead", frames - sizes.total()
                    p95 = quantile(sizes, 0.95)
                    yield Measured(variant, measured, where, frames, missing, value, p95, low, high)


def _ranged(every: Floats) -> tuple[float, float, float]:
    """Return the first of the stances' values, and the least and the greatest of all."""
    if len(every) > 1 and not np.isnan(every).any():
        return float(every[0]), float(every.min()), float(every.max())
    return float(every[0]), math.nan, math.nan


def differences_of(metres: FrameMetres) -> Floats:
    """Return mask minus truth, ``(S, M)`` metres: positive where the mask reaches too far.

    Too far is to the outside of an edge of the road, or ahead.
    """
    outwards = [1 if measure in (LEFT, FREE) else -1 for measure, _ in metres.measures]
    found: Floats = (metres.ends[..., 0] - metres.ends[..., 1]) * outwards
    return found


def quantile(counter: Counter[int], share: float) -> float:
    """Return the least of some counted centimetres that a share of them does not exceed, in metres.

    NaN without any.
    """
    total, so_far = counter.total(), 0
    for value in sorted(counter):
        so_far += counter[value]
        if so_far >= share * total:
            return value / CENTIMETRES
    return math.nan


def _final(curves: Curves, variant: str) -> Sums | None:
    found = [counts for (own, _), counts in curves.counts.items() if own == variant]
    return found[-1] if found else None


def kitti(counts: Sums, histogram: Sums | None) -> dict[str, float]:
    """Compute what KITTI's road benchmark does, of cells of the ground seen from above [1]_.

    Of a mask, ``(4,)`` TP, TN, FP and FN: its ``F1``, ``precision`` and ``recall``. Given the cells
    by how probable road is, ``(2, 65536)`` non-road and road: ``MaxF``, the greatest F1 of 256
    thresholds, with the precision and recall there; and ``AP``, the mean over eleven recalls from 0
    to 1 of the greatest precision at that recall or more. NaN without road.

    References
    ----------
    .. [1] J. Fritsch, T. Kuehnl, A. Geiger, A New Performance Measure and Evaluation Benchmark for
       Road Detection Algorithms, ITSC 2013.
    """
    tp, _, fp, fn = counts.tolist()
    if histogram is None or not histogram[1].sum():
        nan = math.nan
        return {
            "F1": 2 * tp / (2 * tp + fp + fn) if tp + fp + fn else nan,
            "precision": tp / (tp + fp) if tp + fp else nan,
            "recall": tp / (tp + fn) if tp + fn else nan,
        }
    # Road is what has at least the probability k / 255.
    below = np.concatenate([np.zeros((2, 1), np.int64), histogram.cumsum(axis=1)], axis=1)
    steps = np.arange(LEVELS) * (CODES - 1) // (LEVELS - 1)
    negative, positive = below[:, -1:] - below[:, steps]
    found = positive > 0
    precision = positive[found] / (positive + negative)[found]
    recall = positive[found] / below[1, -1]
    f = 2 * precision * recall / (precision + recall)
    best = int(f.argmax())
    reached = [precision[recall >= least] for least in RECALLS]
    return {
        "MaxF": float(f[best]),
        "AP": float(np.mean([each.max() if len(each) else 0.0 for each in reached])),
        "precision": float(precision[best]),
        "recall": float(recall[best]),
    }
