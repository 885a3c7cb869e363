"""What every threshold on a probability of road would give, from counts of pixels by its code.

A stage that says how probable road is (`roadeval.data.Output.probability`) is one method for each
threshold: road is what has at least that. All labelled pixels of a drive count alike, as in
KITTI's road benchmark [1]_. Two integers a code are kept, so memory does not grow with the drive,
and the order of the frames makes no difference.

Beside them: heat maps of errors, and the pixels that one mask repairs or spoils against another.

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
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise, permutations
from typing import Any, Final, NamedTuple

import numpy as np

from roadeval.data import (
    CERTAIN,
    CODES,
    Change,
    Histogram,
    Transition,
    TruthBits,
    as_tree,
    best_code,
    everywhere,
    ones,
    wrong_above,
)
from roadeval.data.arrays import FN, FP, IGNORED, Bits, Floats, Plane, Sums
from roadeval.data.result import Cells
from roadeval.evaluation.score.counts import Name, flat
from roadeval.kernels import KERNELS

LEVELS: Final = 256
"""Levels of the table: each holds as many codes as it."""


def at_levels(counts: Sums) -> Sums:
    """Return ``(2, 65536)`` counts summed up in levels of 256 codes, ``(2, 256)``."""
    levels: Sums = counts.reshape(2, LEVELS, -1).sum(axis=2)
    return levels


class Thresholds(NamedTuple):
    """The outcomes at each threshold, from the highest to the lowest that occurs."""

    codes: Sums
    """``(n,)`` int64: road is what has at least this code, or is at least of this level."""
    tp: Sums
    fp: Sums
    """``(n,)`` int64: road and non-road pixels that are called road."""
    road: int
    other: int
    """All road and non-road pixels."""

    @classmethod
    def of(cls, counts: Cells) -> Thresholds:
        """Return the thresholds of ``(2, n)`` counts of non-road and road by code or level."""
        found = np.flatnonzero(counts.any(axis=0))[::-1]
        fp, tp = counts[:, found].astype(np.int64).cumsum(axis=1)
        other, road = counts.sum(axis=1, dtype=np.int64).tolist()
        return cls(found, tp, fp, road, other)

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

        Without interpolation, as scikit-learn's ``average_precision_score``; KITTI's and Pascal
        VOC's interpolate precision and come out a little higher.
        """
        steps = np.diff(self.recall, prepend=0.0)
        return float((steps * self.precision).sum()) if self.road else math.nan

    def max_f(self) -> dict[str, float | None]:
        """Return MaxF, the greatest ``F = 2 TP / (2 TP + FP + FN)`` over thresholds, F1 in [1]_.

        With it the ``threshold`` as a fraction, of equal ones the highest, and the ``precision``
        and ``recall`` there; all None without road.
        """
        names = "MaxF", "threshold", "precision", "recall"
        if not self.road:
            return dict.fromkeys(names)
        f = 2 * self.tp / (self.tp + self.fp + self.road)
        best = int(f.argmax())
        at = f[best], self.codes[best] / (CODES - 1), self.precision[best], self.recall[best]
        return dict(zip(names, map(float, at), strict=True))


def calibration(counts: Sums) -> dict[str, float]:
    """Return how far probabilities are what they say, from ``(2, 65536)`` counts by code.

    ``ECE`` is the expected calibration error ``sum_b n_b / n |r_b - p_b|`` over 256 levels of equal
    width: ``n_b`` pixels of a level, the share ``r_b`` of road among them, and ``p_b`` the mean of
    their probabilities [2]_. ``confidence`` is the mean of ``max(p, 1 - p)``, and ``right`` the
    share of pixels that are right where road is what is more probable than one half.
    """
    pixels, p = counts.sum(axis=0), np.arange(CODES) / CERTAIN
    road, stated = (own.reshape(LEVELS, -1).sum(axis=1) for own in (counts[1], pixels * p))
    found = {
        "ECE": np.abs(road - stated).sum(),
        "confidence": (pixels * np.maximum(p, 1 - p)).sum(),
        "right": pixels.sum() - wrong_above(counts)[round(CERTAIN / 2)],
    }
    return {name: float(value / pixels.sum()) for name, value in found.items()}


class Curves:
    """The labelled pixels of a drive by how probable road is, for each variant and stage."""

    def __init__(self) -> None:
        self.counts: dict[Name, Sums] = {}
        """``(2, 65536)`` int64 each, or of the ground ``(2, 256)``: non-road and road."""
        self._frames: Counter[Name] = Counter()

    def at_best_of(self, others: Curves) -> dict[str, dict[str, dict[str, float]]]:
        """Return ERR of all pixels at the threshold that errs least on other frames.

        By variant and stage of both: the ``threshold`` as a fraction, and ``ERR``.
        """
        found = {}
        for name in (name for name in self.counts if name in others.counts):
            code, counts = best_code(others.counts[name]), self.counts[name]
            err = float(wrong_above(counts)[code] / counts.sum())
            found[name] = {"threshold": code / (CODES - 1), "ERR": err}
        return as_tree(found.items())

    def add(self, histograms: Mapping[Name, Histogram]) -> None:
        """Add the histograms of a frame."""
        for name, counts in histograms.items():
            self._frames[name] += 1
            self.counts[name] = self.counts.get(name, 0) + counts.astype(np.int64)

    def totals(self) -> dict[str, dict[str, dict[str, Any]]]:
        """Return by variant and stage what is quoted of curves, fit for JSON.

        The ``frames``, ``AP``, and what `Thresholds.max_f` and `calibration` find.
        """
        found = {}
        for name, counts in self.counts.items():
            own, frames = Thresholds.of(counts), self._frames[name]
            area = {"frames": frames, "AP": own.average_precision}
            found[name] = {**area, **own.max_f(), **calibration(counts)}
        return as_tree(found.items())


CELLS: Final = 160
"""Cells across the longer side of a heat map, at most."""
PENDING: Final = 255
"""Frames whose sum fits in a byte: adding bytes is ten times as fast as adding integers."""


class HeatMap:
    """How often each pixel was labelled, and was a false positive or a false negative.

    Summed up in square cells, no more than `CELLS` across the longer side: a sum a pixel would be
    a large part of a run's memory. Frames of another size than the first are left out.
    """

    def __init__(self) -> None:
        self.frames = 0
        self._side = 1
        self._sums = np.zeros((3, 0, 0), np.int64)
        self._bytes = np.zeros((3, 0, 0), np.uint8)

    def add(self, errors: Plane) -> None:
        """Add a frame's errors, ``(H, W)`` uint8 in the classes of `roadeval.data.ERRORS`."""
        if not self.frames:
            self._side = max(1, -(-max(errors.shape) // CELLS))
            self._bytes = np.zeros((3, *errors.shape), np.uint8)
            self._sums = np.zeros((3, *(-(-n // self._side) for n in errors.shape)), np.int64)
        if errors.shape != self._bytes.shape[1:]:
            return
        if self.frames and self.frames % PENDING == 0:
            self._carry()
        self.frames += 1
        counted = errors != IGNORED, errors == FP, errors == FN
        self._bytes += np.array(counted)

    def cells(self) -> tuple[int, Sums]:
        """Return the cells' side in pixels, and their sums.

        These are ``(3, rows, columns)`` int64: pixels that were labelled, FP and FN, over all
        frames. The last row and column may be narrower.
        """
        self._carry()
        return self._side, self._sums.copy()

    def _carry(self) -> None:
        # A row of cells at a time: sums of a whole frame would be eight times as large as it.
        columns = np.arange(0, self._bytes.shape[2], self._side)
        for row in range(self._sums.shape[1]):
            band = self._bytes[:, row * self._side : (row + 1) * self._side]
            sums = band.sum(axis=1, dtype=np.int64)
            self._sums[:, row] += np.add.reduceat(sums, columns, axis=1)
        self._bytes[:] = 0


def changes(names: Sequence[Name], masks: Bits, truth: TruthBits) -> dict[Transition, Change]:
    """Count what each stage changed in the mask before it, and each final mask in the others.

    ``names`` are variant and stage of each mask, a variant's in the order they ran; ``masks`` are
    ``(K, H, words)``. Ignored pixels are in no count.
    """
    labelled = truth.labelled
    whole = ones(labelled)
    wrong = flat((masks ^ truth.road) & labelled)
    both = KERNELS.count_bits(wrong, wrong, flat([everywhere(truth.shape)]))[..., 0].tolist()
    found = {}
    for before, after in _steps(names):
        repaired, spoiled = (both[each][each] - both[before][after] for each in (before, after))
        found[*names[before], *names[after]] = Change(repaired, spoiled, whole)
    return found


def _steps(names: Sequence[Name]) -> Iterator[tuple[int, int]]:
    """Yield the places of a mask before and after: stage to stage, and final to final."""
    for before, after in pairwise(range(len(names))):
        if names[before][0] == names[after][0]:
            yield before, after
    last = {variant: place for place, (variant, _) in enumerate(names)}
    yield from permutations(last.values(), 2)
