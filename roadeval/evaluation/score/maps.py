"""Heat maps of errors, and the pixels that one mask repairs or spoils against another."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, permutations
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Change, Layer, Transition, TruthBits, everywhere, ones
from roadeval.data.arrays import Bits, Sums
from roadeval.evaluation.score.counts import Name, flat
from roadeval.kernels import KERNELS

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

    def add(self, errors: npt.NDArray[np.uint8]) -> None:
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
        KERNELS.add_outcomes(errors, self._bytes)

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


@dataclass(slots=True)
class Maps:
    """The heat map of every variant's final mask, and every change between masks, of a drive."""

    heat: dict[str, HeatMap] = field(default_factory=dict)
    changes: dict[Transition, Change] = field(default_factory=dict)
    frames: int = 0

    def add(self, errors: Mapping[str, Layer], found: Mapping[Transition, Change]) -> None:
        """Add a frame: the final masks' errors by variant, and what `changes` counted."""
        self.frames += 1
        for variant, layer in errors.items():
            self.heat.setdefault(variant, HeatMap()).add(layer.array.astype(np.uint8, copy=False))
        for step, change in found.items():
            self.changes[step] = self.changes.get(step, Change()) + change
