"""Pixel counts of a mask against the truth, and what changed from one mask to another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

OUTCOMES: Final = ("TP", "TN", "FP", "FN")
"""The columns of `Counts` in tables, in the order of its fields."""


@dataclass(frozen=True, slots=True)
class Counts:
    """Pixels by outcome; road is the positive class, ignored pixels are in none (section 5)."""

    tp: int = 0
    tn: int = 0
    fp: int = 0
    fn: int = 0

    @property
    def n(self) -> int:
        """Road and non-road pixels of the truth, N in Eq. 24-25."""
        return self.tp + self.tn + self.fp + self.fn

    def __add__(self, other: Counts) -> Counts:
        return Counts(
            self.tp + other.tp, self.tn + other.tn, self.fp + other.fp, self.fn + other.fn
        )


@dataclass(frozen=True, slots=True)
class Tally:
    """The counts of one stage of one variant on one frame, whole and by region.

    ``rates`` are the fractions of Eq. 24-29 by name; an undefined one is NaN.
    """

    variant: str
    stage: str
    counts: Counts
    regions: Mapping[str, Counts] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Change:
    """Pixels that one mask repairs and spoils against another.

    ``repaired`` are newly right, ``spoiled`` newly wrong, of the ``labelled`` ones.
    """

    repaired: int = 0
    spoiled: int = 0
    labelled: int = 0

    def __add__(self, other: Change) -> Change:
        return Change(
            self.repaired + other.repaired,
            self.spoiled + other.spoiled,
            self.labelled + other.labelled,
        )


Transition = tuple[str, str, str, str]
"""From one mask to another: variant and stage before, variant and stage after."""
