"""The rates at every threshold on the probability of road, from counts of pixels by probability.

A stage with probabilities (`roadeval.data.Output.probability`) gives a mask for each threshold:
pixels with at least that probability are road. All labelled pixels of a drive have equal weight, as
in KITTI's road benchmark [1]_. Two integers are kept for each 16-bit code of a probability, so
memory does not grow with the drive, and the order of the frames makes no difference. Heat maps of
errors are here, too.

References
----------
.. [1] J. Fritsch, T. Kuehnl, A. Geiger, A New Performance Measure and Evaluation Benchmark for
   Road Detection Algorithms, ITSC 2013.
.. [2] M. P. Naeini, G. F. Cooper, M. Hauskrecht, Obtaining Well Calibrated Probabilities Using
   Bayesian Binning, AAAI 2015; torchmetrics' ``BinaryCalibrationError(n_bins=256, norm="l1")``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from roadeval.data import CERTAIN, CODES, Histogram, as_tree, best_code, wrong_above
from roadeval.data.arrays import FN, FP, IGNORED, Floats, Plane, Sums
from roadeval.data.result import AnyArray
from roadeval.evaluation.score.counts import Name

LEVELS: Final = 256
"""Levels of the table ``probabilities``; each holds 256 codes."""


def at_levels(counts: Sums) -> Sums:
    """Sum up ``(2, 65536)`` counts in levels of 256 codes, ``(2, 256)``."""
    levels: Sums = counts.reshape(2, LEVELS, -1).sum(axis=2)
    return levels


class Thresholds(NamedTuple):
    """The outcomes at each threshold, from the highest to the lowest that occurs."""

    codes: Sums
    """``(n,)`` int64: pixels of at least this code, or level, are called road."""
    tp: Sums
    fp: Sums
    """``(n,)`` int64: road and non-road pixels that are called road."""
    road: int
    other: int
    """Numbers of all road and of all non-road pixels."""

    @classmethod
    def of(cls, counts: AnyArray) -> Thresholds:
        """Return the thresholds from ``(2, n)`` counts of non-road and road by code or level."""
        codes = np.flatnonzero(counts.any(axis=0))[::-1]
        fp, tp = counts[:, codes].astype(np.int64).cumsum(axis=1)
        other, road = counts.sum(axis=1, dtype=np.int64).tolist()
        return cls(codes, tp, fp, road, other)

    @property
    def precision(self) -> Floats:
        """``TP / (TP + FP)``."""
        return self.tp / (self.tp + self.fp)

    @property
    def recall(self) -> Floats:
        """``TP / (TP + FN)``, the TPR; NaN without road."""
        return self.tp / (self.road or math.nan)

    @property
    def average_precision(self) -> float:
        """AP, ``sum (R_k - R_(k-1)) P_k`` over falling thresholds; NaN without road.

        It is computed without interpolation, as in scikit-learn's ``average_precision_score``;
        KITTI and Pascal VOC interpolate precision and get slightly higher values.
        """
        steps = np.diff(self.recall, prepend=0.0)
        return float((steps * self.precision).sum()) if self.road else math.nan

    def max_f(self) -> dict[str, float | None]:
        """Return MaxF, the greatest ``F = 2 TP / (2 TP + FP + FN)`` over thresholds, F1 in [1]_.

        The result also has the ``threshold`` as a fraction, the highest of equally good ones, and
        the ``precision`` and ``recall`` there; all are None without road.
        """
        names = "MaxF", "threshold", "precision", "recall"
        if not self.road:
            return dict.fromkeys(names)
        f = 2 * self.tp / (self.tp + self.fp + self.road)
        best = int(f.argmax())
        at = f[best], self.codes[best] / (CODES - 1), self.precision[best], self.recall[best]
        return dict(zip(names, map(float, at), strict=True))


def calibration(counts: Sums) -> dict[str, float]:
    """Return how well probabilities are calibrated, from ``(2, 65536)`` counts by code.

    ``ECE`` is the expected calibration error ``sum_b n_b / n |r_b - p_b|`` over 256 levels of equal
    width: ``n_b`` pixels of a level, the share ``r_b`` of road among them, and ``p_b`` the mean of
    their probabilities [2]_. ``confidence`` is the mean of ``max(p, 1 - p)``, and ``right`` the
    share of pixels that are right at a threshold of one half.
    """
    pixels, p = counts.sum(axis=0), np.arange(CODES) / CERTAIN
    road, expected = (codes.reshape(LEVELS, -1).sum(axis=1) for codes in (counts[1], pixels * p))
    sums = {
        "ECE": np.abs(road - expected).sum(),
        "confidence": (pixels * np.maximum(p, 1 - p)).sum(),
        "right": pixels.sum() - wrong_above(counts)[round(CERTAIN / 2)],
    }
    return {name: float(value / pixels.sum()) for name, value in sums.items()}


class Curves:
    """The labelled pixels of a drive by probability of road, for each variant and stage."""

    def __init__(self) -> None:
        self.counts: dict[Name, Sums] = {}
        """Pixels of non-road and road, ``(2, 65536)`` int64, or cells of ground, ``(2, 256)``."""
        self.frames: Counter[Name] = Counter()

    def at_best_of(self, others: Curves) -> dict[str, dict[str, dict[str, float]]]:
        """Return ERR of all pixels at the threshold that is best on other frames.

        The result has, by variant and stage, the ``threshold`` as a fraction, and ``ERR``.
        """
        rates = {}
        for name in (name for name in self.counts if name in others.counts):
            code, counts = best_code(others.counts[name]), self.counts[name]
            err = float(wrong_above(counts)[code] / counts.sum())
            rates[name] = {"threshold": code / (CODES - 1), "ERR": err}
        return as_tree(rates.items())

    def add(self, histograms: Mapping[Name, Histogram]) -> None:
        """Add the histograms of a frame."""
        for name, counts in histograms.items():
            self.frames[name] += 1
            self.counts[name] = self.counts.get(name, 0) + counts.astype(np.int64)

    def totals(self) -> dict[str, dict[str, dict[str, Any]]]:
        """Return the key figures of each curve by variant and stage, fit for JSON.

        They are ``frames``, ``AP``, and the values of `Thresholds.max_f` and `calibration`.
        """
        figures = {}
        for name, counts in self.counts.items():
            thresholds, frames = Thresholds.of(counts), self.frames[name]
            area = {"frames": frames, "AP": thresholds.average_precision}
            figures[name] = {**area, **thresholds.max_f(), **calibration(counts)}
        return as_tree(figures.items())


CELLS: Final = 160
"""Greatest number of cells along the longer side of a heat map."""
PENDING: Final = 255
"""Number of frames that are summed up in bytes, which takes a tenth of the time of integers."""


class HeatMap:
    """The numbers of frames on which each pixel was labelled, a false positive, a false negative.

    They are summed up in square cells of at least 8 pixels a side, at most `CELLS` across: a sum
    per pixel takes much memory and disk. Frames of another size than the first are left out.
    """

    def __init__(self) -> None:
        self.frames = 0
        self._side = 1
        self._sums = np.zeros((3, 0, 0), np.int64)
        self._bytes = np.zeros((3, 0, 0), np.uint8)

    def add(self, errors: Plane) -> None:
        """Add a frame's errors, ``(H, W)`` uint8 in the classes of `roadeval.data.ERRORS`."""
        if not self.frames:
            self._side = max(8, -(-max(errors.shape) // CELLS))
            self._bytes = np.zeros((3, *errors.shape), np.uint8)
            self._sums = np.zeros((3, *(-(-n // self._side) for n in errors.shape)), np.int64)
        if errors.shape != self._bytes.shape[1:]:
            return
        if self.frames and self.frames % PENDING == 0:
            self._carry()
        self.frames += 1
        self._bytes += np.array([errors != IGNORED, errors == FP, errors == FN])

    def cells(self) -> tuple[int, Sums]:
        """Return the side of the cells in pixels, and their sums, ``(3, rows, columns)`` int64.

        The sums count labelled pixels, FP and FN over all frames. The last row and column may be
        narrower.
        """
        self._carry()
        return self._side, self._sums.copy()

    def _carry(self) -> None:
        # One row of cells at a time: sums of a whole frame would take eight times its memory.
        columns = np.arange(0, self._bytes.shape[2], self._side)
        for row in range(self._sums.shape[1]):
            band = self._bytes[:, row * self._side : (row + 1) * self._side]
            sums = band.sum(axis=1, dtype=np.int64)
            self._sums[:, row] += np.add.reduceat(sums, columns, axis=1)
        self._bytes[:] = 0
