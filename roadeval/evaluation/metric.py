"""Metrics: pure functions of pixel counts, with name, title, formula, unit and direction."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from roadeval.data import Counts


class Shown(IntEnum):
    """Places where people see a metric; each includes the places before it."""

    IN_FILES = 0
    """Columns of the tables and series of the recording only."""
    IN_FULL = 1
    """Also tables of all rates of a mask: key tables, rows over the drive, paired differences."""
    EVERYWHERE = 2
    """Also short tables and lists, graphs and charts."""


@dataclass(frozen=True)
class Metric:
    """A number that is computed from the counts of one mask."""

    name: str
    """Column of the tables, such as ``ERR``."""
    title: str
    """A few words for a person, such as ``error rate``."""
    formula: str
    """Formula in ``TP``, ``TN``, ``FP``, ``FN`` and ``N``."""
    function: Callable[[Counts], float]
    """Computes it from a frame's counts, or elementwise if each count is an array; NaN if it is
    undefined, see `ratio`."""
    higher_is_better: bool
    """The direction of improvement."""
    order: int
    """Its place among the columns; the paper's metrics bear their equations' numbers."""
    rank: int = 10
    """Its place where people read it, the lowest first; equal ones are ranked by ``order``."""
    meaning: str = ""
    """Plain words for what it counts; empty if the title says it."""
    unit: str = "fraction"
    """Unit of the value in tables."""
    shown: Shown = Shown.EVERYWHERE
    """Places where people see it; a mirror of another, as ``TPR = 1 - FNR``, is in files only."""
    tabled: bool = True
    """Whether it is a column of the tables; if not, only totals have it, and results that were made
    before it was added can still be read."""

    @property
    def in_words(self) -> str:
        """Its meaning, or else its title."""
        return self.meaning or self.title


def ratio(part: int, total: int) -> float:
    """Divide; a ratio with denominator 0 is undefined: NaN, never 0 or 1."""
    try:
        return part / total  # for arrays, NumPy gives NaN for 0 / 0
    except ZeroDivisionError:
        return math.nan
