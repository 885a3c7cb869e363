"""Metrics: pure functions of pixel counts, with name, title, formula, unit and direction."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from roadeval.data import Counts


class Shown(IntEnum):
    """Where people see a metric; each place includes those before it."""

    IN_FILES = 0
    """A column of the tables and a series of the recording, and no more."""
    IN_FULL = 1
    """Where all rates of a mask are: key tables, rows over the drive, paired differences."""
    EVERYWHERE = 2
    """Short tables and lists, graphs and charts, too."""


@dataclass(frozen=True)
class Metric:
    """A number that is computed from the counts of one mask."""

    name: str
    """Column of the tables, as ``ERR``."""
    title: str
    """A few words for a person, as ``error rate``."""
    formula: str
    """In ``TP``, ``TN``, ``FP``, ``FN`` and ``N``."""
    function: Callable[[Counts], float]
    """Computes it of a frame's counts, and elementwise where each count is an array. Undefined is
    NaN, as `ratio` does it.
    """
    higher_is_better: bool
    """The direction of improvement."""
    order: int
    """Its place among the columns; the paper's metrics bear their equations' numbers."""
    rank: int = 10
    """Its place where people read it, the lowest first; of equal ones by ``order``."""
    meaning: str = ""
    """What it counts, in plain words; empty where the title says it."""
    unit: str = "fraction"
    """Of the value in tables."""
    shown: Shown = Shown.EVERYWHERE
    """Where people see it; one that mirrors another, as ``TPR = 1 - FNR``, in files alone."""
    tabled: bool = True
    """Whether it is a column of the tables. One that is not is computed of sums alone."""

    @property
    def in_words(self) -> str:
        """What it counts, or else its title."""
        return self.meaning or self.title


def ratio(part: int, whole: int) -> float:
    """Divide; where the denominator is 0 the ratio is undefined: NaN, never 0 or 1."""
    try:
        return part / whole  # arrays divide nothing by nothing to NaN by themselves
    except ZeroDivisionError:
        return math.nan
