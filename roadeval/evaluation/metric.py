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
    """Computes the metric from the counts of a frame, or elementwise from arrays of counts; NaN if
    it is undefined, see `ratio`."""
    higher_is_better: bool
    """The direction of improvement."""
    order: int
    """Position among the columns; for a metric of the paper, the number of its equation."""
    rank: int = 10
    """Position where people read it, the lowest first; equal ranks are sorted by ``order``."""
    meaning: str = ""
    """Plain words for what it counts; empty if the title says it."""
    unit: str = "fraction"
    """Unit of the value in tables."""
    shown: Shown = Shown.EVERYWHERE
    """Places where people see it; a complement, such as ``TPR = 1 - FNR``, is in files only."""
    tabled: bool = True
    """Whether it is a column of the tables. If not, it is in the totals only, and results from
    before it was added can still be read."""

    @property
    def in_words(self) -> str:
        """The meaning, or the title if ``meaning`` is empty."""
        return self.meaning or self.title


def ratio(part: int, total: int) -> float:
    """Return ``part / total``; NaN if ``total`` is 0, never 0 or 1."""
    try:
        return part / total  # for arrays, NumPy gives NaN for 0 / 0
    except ZeroDivisionError:
        return math.nan
