"""Where and when pixels go wrong, summed up over masks: heat maps, and what a step changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise, permutations

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, NON_ROAD, ROAD, Mask, Truth

Sums = npt.NDArray[np.int32]


@dataclass(slots=True)
class HeatMap:
    """How often each pixel was labelled, and was a false positive or a false negative.

    All ``(H, W)`` int32. Frames of another size than the first are left out, and counted.
    """

    frames: int = 0
    left_out: int = 0
    labelled: Sums = field(default_factory=lambda: np.zeros((0, 0), np.int32))
    fp: Sums = field(default_factory=lambda: np.zeros((0, 0), np.int32))
    fn: Sums = field(default_factory=lambda: np.zeros((0, 0), np.int32))

    def add(self, mask: Mask, truth: Truth) -> None:
        """Add a frame's mask (0, 1) and truth (0, 1, 255), both ``(H, W)`` uint8."""
        if not self.frames:
            self.labelled, self.fp, self.fn = (np.zeros(truth.shape, np.int32) for _ in range(3))
        if truth.shape != self.labelled.shape:
            self.left_out += 1
            return
        self.frames += 1
        self.labelled += truth != IGNORE
        self.fp += (mask == 1) & (truth == NON_ROAD)
        self.fn += (mask == 0) & (truth == ROAD)

    def share(self, which: Sums) -> npt.NDArray[np.float64]:
        """Divide by how often a pixel was labelled; NaN where it never was."""
        whole = self.labelled.astype(float)
        share = np.full(whole.shape, np.nan)
        np.divide(which, whole, out=share, where=whole > 0)
        return share


@dataclass(frozen=True, slots=True)
class Change:
    """What became of the pixels from one mask to another: newly right, newly wrong."""

    repaired: int = 0
    spoiled: int = 0
    labelled: int = 0

    def __add__(self, other: Change) -> Change:
        return Change(
            self.repaired + other.repaired,
            self.spoiled + other.spoiled,
            self.labelled + other.labelled,
        )


def change(before: Mask, after: Mask, truth: Truth) -> Change:
    """Count the labelled pixels that ``after`` has right and ``before`` wrong, and the reverse.

    Masks are ``(H, W)`` uint8 (0, 1), the truth (0, 1, 255).
    """
    differ = (before != after) & (truth != IGNORE)
    right = differ & (after == truth)
    repaired = int(np.count_nonzero(right))
    spoiled = int(np.count_nonzero(differ)) - repaired
    return Change(repaired, spoiled, int(np.count_nonzero(truth != IGNORE)))


@dataclass(slots=True)
class Maps:
    """The heat map of every variant's final mask, and every change between its masks.

    ``changes`` are by (variant, stage before, stage after) and ``paired`` by (variant, variant),
    final mask against final mask.
    """

    heat: dict[str, HeatMap] = field(default_factory=dict)
    changes: dict[tuple[str, str, str], Change] = field(default_factory=dict)
    paired: dict[tuple[str, str], Change] = field(default_factory=dict)
    frames: int = 0

    def add(self, truth: Truth, masks: Mapping[str, Mapping[str, Mask]]) -> None:
        """Add a frame: its truth, and the masks by variant and stage in the order they ran."""
        self.frames += 1
        for variant, stages in masks.items():
            names = list(stages)
            for before, after in pairwise(names):
                key = variant, before, after
                step = change(stages[before], stages[after], truth)
                self.changes[key] = self.changes.get(key, Change()) + step
            self.heat.setdefault(variant, HeatMap()).add(stages[names[-1]], truth)
        last = {variant: list(stages.values())[-1] for variant, stages in masks.items()}
        for control, treated in permutations(last, 2):
            found = self.paired.get((treated, control), Change())
            self.paired[treated, control] = found + change(last[control], last[treated], truth)
