"""Measures in metres summed up over a drive, and how far a wrong camera would move them."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from roadeval.data import FrameMetres
from roadeval.data.arrays import Bits, Floats, Sums, TruthBits
from roadeval.evaluation.metres import ABOVE, FREE, LEFT, Survey
from roadeval.evaluation.score.counts import count
from roadeval.evaluation.score.thresholds import Curves

RECALLS: Final = np.linspace(0, 1, 11)
CENTIMETRES: Final = 100
SPAN: Final = 1 << 20
"""More centimetres than two ends can lie apart, in either direction."""


@dataclass(frozen=True)
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
    counts = count(bits, truth, [*inside, *survey.digits])[:, 1:]
    by_band, by_digit = (
        part.reshape(len(bits), survey.stances, -1, 4)
        for part in np.split(counts, [len(inside)], axis=1)
    )
    cells = (by_digit << np.arange(by_digit.shape[2])[:, None]).sum(axis=2)
    counts = np.concatenate([by_band, cells[:, :, None]], axis=2)
    ends, regions = survey.ends(bits, truth), (*survey.bands[0], ABOVE)
    return {
        name: FrameMetres(survey.measures, ends[place], regions, counts[place])
        for place, name in enumerate(masks)
    }


class MetreSums:
    """Sums up the measures of final masks, by variant."""

    def __init__(self) -> None:
        self._measures: Sequence[tuple[str, int]] = ()
        self._regions: Sequence[str] = ()
        self._differences: Final[defaultdict[str, Counter[int]]] = defaultdict(Counter)
        """How often each difference in centimetres, plus `SPAN` times the place of its stance and
        measure."""
        self._seen: Final[dict[str, Sums]] = {}
        """``(M,)``: frames on which the truth has the measure."""
        self._rates: Final[dict[str, Floats]] = {}
        """``(S, R, 2)``: sums of the frames' ERR, and frames that have one."""
        self._above: Final[dict[str, Sums]] = {}
        """``(4,)``: cells of the ground seen from above, by outcome."""

    def add(self, metres: Mapping[str, FrameMetres]) -> None:
        """Add a frame's measures."""
        for variant, own in metres.items():
            self._measures, self._regions = own.measures, own.regions
            self._seen[variant] = self._seen.get(variant, 0) + ~np.isnan(own.ends[0, :, 1])
            differences = differences_of(own).ravel()
            keys = np.rint(differences * CENTIMETRES) + SPAN * np.arange(len(differences))
            self._differences[variant].update(keys[~np.isnan(keys)].astype(int).tolist())
            labelled, wrong = own.counts.sum(axis=2), own.counts[..., 2:].sum(axis=2)
            known = labelled > 0
            shares = np.divide(wrong, labelled, out=np.zeros(wrong.shape), where=known)
            self._rates[variant] = self._rates.get(variant, 0) + np.stack([shares, known], axis=2)
            self._above[variant] = self._above.get(variant, 0) + own.counts[0, -1]

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
            for place, (measured, at) in enumerate(self._measures):
                every = [
                    self._of(variant, stance * len(self._measures) + place)
                    for stance in range(len(sums))
                ]
                value, low, high = _ranged(np.array([quantile(each, 0.5) for each in every]))
                frames = int(self._seen[variant][place])
                p95 = quantile(np.abs(every[0]), 0.95)
                where, missing = f"{at}m" if at else "ahead", frames - len(every[0])
                yield Measured(variant, measured, where, frames, missing, value, p95, low, high)

    def _of(self, variant: str, place: int) -> Floats:
        """Return a variant's differences at a place, ``(n,)`` metres, in no order."""
        counter = self._differences[variant]
        keys, counts = (np.array([*each], np.int64) for each in (counter, counter.values()))
        own = np.abs(keys - place * SPAN) < SPAN // 2
        metres: Floats = (keys[own] - place * SPAN) / CENTIMETRES
        return np.repeat(metres, counts[own])


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


def quantile(metres: Floats, share: float) -> float:
    """Return the least of ``(n,)`` values that a share of them does not exceed; NaN without any."""
    if not len(metres):
        return math.nan
    return float(np.quantile(metres, share, method="inverted_cdf"))


def _final(curves: Curves, variant: str) -> Sums | None:
    found = [counts for (own, _), counts in curves.counts.items() if own == variant]
    return found[-1] if found else None


def kitti(counts: Sums, levels: Sums | None) -> dict[str, float]:
    """Compute what KITTI's road benchmark does, of cells of the ground seen from above [1]_.

    Of a mask, ``(4,)`` TP, TN, FP and FN: its ``F1``, ``precision`` and ``recall``. Given the cells
    by how probable road is, ``(2, 256)`` as of `Survey.levels`: ``MaxF``, the greatest F1 of 256
    thresholds, with the precision and recall there; and ``AP``, the mean over eleven recalls from 0
    to 1 of the greatest precision at that recall or more. NaN without road.

    References
    ----------
    .. [1] J. Fritsch, T. Kuehnl, A. Geiger, A New Performance Measure and Evaluation Benchmark for
       Road Detection Algorithms, ITSC 2013.
    """
    tp, _, fp, fn = counts.tolist()
    if levels is None or not levels[1].sum():
        nan = math.nan
        return {
            "F1": 2 * tp / (2 * tp + fp + fn) if tp + fp + fn else nan,
            "precision": tp / (tp + fp) if tp + fp else nan,
            "recall": tp / (tp + fn) if tp + fn else nan,
        }
    # Road is what has at least the probability k / 255.
    negative, positive = levels[:, ::-1].cumsum(axis=1)[:, ::-1]
    found = positive > 0
    precision = positive[found] / (positive + negative)[found]
    recall = positive[found] / positive[0]
    f = 2 * precision * recall / (precision + recall)
    best = int(f.argmax())
    reached = [precision[recall >= least] for least in RECALLS]
    return {
        "MaxF": float(f[best]),
        "AP": float(np.mean([each.max() if len(each) else 0.0 for each in reached])),
        "precision": float(precision[best]),
        "recall": float(recall[best]),
    }
