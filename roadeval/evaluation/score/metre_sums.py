"""Measures in metres, summed up over a drive, and their change with other camera stances."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from roadeval.data import Counts, FrameMetres
from roadeval.data.arrays import Bits, Floats, Sums, TruthBits
from roadeval.evaluation import metrics
from roadeval.evaluation.metres import ABOVE, FREE, LEFT, Survey
from roadeval.evaluation.score.counts import count
from roadeval.evaluation.score.thresholds import Curves

CENTIMETRES: Final = 100


def measure(survey: Survey, masks: Mapping[str, Bits], truth: TruthBits) -> dict[str, FrameMetres]:
    """Return the measures of masks, ``(H, words)`` each, against the truth, by name.

    The last region of each is the ground seen from above.
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
        self._differences = defaultdict[tuple[str, int], Counter[int]](Counter)
        """How often each difference in centimetres occurs, by variant and place in ``(S, M)``."""
        self._seen: dict[str, Sums] = {}
        """``(M,)`` by variant: number of frames on which the truth has the measure."""
        self._rates: dict[str, Floats] = {}
        """``(S, R, 2)`` by variant: sum of the frames' ERR, and number of frames that have ERR."""
        self._above: dict[str, Sums] = {}
        """``(4,)`` by variant: ground cells by outcome."""

    def add(self, metres: Mapping[str, FrameMetres]) -> None:
        """Add a frame's measures."""
        for variant, mask in metres.items():
            self._measures, self._regions = mask.measures, mask.regions
            self._seen[variant] = self._seen.get(variant, 0) + ~np.isnan(mask.ends[0, :, 1])
            for place, metres_off in enumerate(differences_of(mask).ravel().tolist()):
                if not math.isnan(metres_off):
                    self._differences[variant, place][round(metres_off * CENTIMETRES)] += 1
            labelled, wrong = mask.counts.sum(axis=2), mask.counts[..., 2:].sum(axis=2)
            defined = labelled > 0
            shares = np.divide(wrong, labelled, out=np.zeros(wrong.shape), where=defined)
            self._rates[variant] = self._rates.get(variant, 0) + np.stack([shares, defined], axis=2)
            self._above[variant] = self._above.get(variant, 0) + mask.counts[0, -1]

    def totals(self, curves: Curves) -> Iterator[dict[str, Any]]:
        """Yield the rows of ``metres``, variant by variant.

        ``curves`` are of the ground seen from above: they give MaxF and AP11 if a final mask comes
        from a threshold on the probability of road.
        """
        levels = {variant: counts for (variant, _), counts in curves.counts.items()}
        names = "variant", "measure", "where", "frames", "missing", "value", "p95", "low", "high"
        for cells in self._rows(levels):
            yield dict(zip(names, cells, strict=True))

    def _rows(self, levels: Mapping[str, Sums]) -> Iterator[tuple[Any, ...]]:
        nan = math.nan
        for variant, sums in self._rates.items():
            for place, region in enumerate(self._regions):
                with np.errstate(invalid="ignore"):
                    value, *ends = _with_range(sums[:, place, 0] / sums[:, place, 1])
                yield (variant, "ERR", region, int(sums[0, place, 1]), 0, value, nan, *ends)
            for name, value in kitti(self._above[variant], levels.get(variant)).items():
                if name not in ("FPR", "FNR"):
                    yield variant, name, ABOVE, 0, 0, value, nan, nan, nan
            for place, (measured, at) in enumerate(self._measures):
                places = range(place, len(sums) * len(self._measures), len(self._measures))
                stances = [self._metres_off(variant, stance_place) for stance_place in places]
                value, *ends = _with_range(np.array([quantile(metres, 0.5) for metres in stances]))
                frames, p95 = int(self._seen[variant][place]), quantile(np.abs(stances[0]), 0.95)
                where, missing = f"{at}m" if at else "ahead", frames - len(stances[0])
                yield (variant, measured, where, frames, missing, value, p95, *ends)

    def _metres_off(self, variant: str, place: int) -> Floats:
        """Return a variant's differences at a place, ``(n,)`` metres, in no particular order."""
        counter = self._differences[variant, place]
        counts = np.array([*counter.values()], int)
        return np.repeat(np.array([*counter], float) / CENTIMETRES, counts)


def _with_range(values: Floats) -> tuple[float, float, float]:
    """Return the first stance's value and the least and greatest of all, NaN for one stance."""
    if len(values) > 1 and not np.isnan(values).any():
        return float(values[0]), float(values.min()), float(values.max())
    return float(values[0]), math.nan, math.nan


def differences_of(metres: FrameMetres) -> Floats:
    """Return mask minus truth, ``(S, M)`` metres: positive if the mask reaches too far.

    That is too far ahead, or beyond the left or right edge of the road.
    """
    outwards = [1 if measure in (LEFT, FREE) else -1 for measure, _ in metres.measures]
    differences: Floats = (metres.ends[..., 0] - metres.ends[..., 1]) * outwards
    return differences


def quantile(metres: Floats, share: float) -> float:
    """Return the least value that a share of the values does not exceed; NaN without any."""
    if not len(metres):
        return math.nan
    return float(np.quantile(metres, share, method="inverted_cdf"))


def kitti(counts: Sums, levels: Sums | None) -> dict[str, float]:
    """Compute the rates of KITTI's road benchmark from cells of the ground seen from above [1]_.

    ``counts`` are a mask's TP, TN, FP and FN, ``(4,)``: they give ``F1``, ``precision`` and
    ``recall``. ``levels`` are the cells by probability of road, ``(2, 256)`` as of
    `Survey.levels`: they give ``MaxF``, the greatest F1 of 256 thresholds, with the rates there;
    and ``AP11``, the mean over eleven recalls from 0 to 1 of the greatest precision at that recall
    or more. All are NaN without road.

    References
    ----------
    .. [1] J. Fritsch, T. Kuehnl, A. Geiger, A New Performance Measure and Evaluation Benchmark for
       Road Detection Algorithms, ITSC 2013.
    """
    if levels is None or not levels[1].sum():
        cells = Counts(*counts.tolist())
        rates = {name: metrics.UNTABLED[name].function(cells) for name in ("F1", "precision")}
        return {**rates, "recall": metrics.METRICS["TPR"].function(cells)}
    # At threshold k, cells with a probability of at least k / 255 are road.
    negative, positive = levels[:, ::-1].cumsum(axis=1)[:, ::-1]
    with_road = positive > 0
    precision = positive[with_road] / (positive + negative)[with_road]
    recall = positive[with_road] / positive[0]
    f = 2 * precision * recall / (precision + recall)
    best = int(f.argmax())
    greatest = [precision[recall >= least].max(initial=0.0) for least in np.linspace(0, 1, 11)]
    return {
        "MaxF": float(f[best]),
        "AP11": float(np.mean(greatest)),
        "precision": float(precision[best]),
        "recall": float(recall[best]),
        "FPR": float(negative[with_road][best] / (negative[0] or math.nan)),
        "FNR": float(1 - recall[best]),
    }
