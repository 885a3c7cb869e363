"""Metrics: pure functions of pixel counts, with name, title, formula, unit and direction."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from roadeval.data import Counts


@dataclass(frozen=True, slots=True)
class Metric:
    """A number that is computed from the counts of one mask.

    Parameters
    ----------
    name
        Column of the tables, as ``ERR``.
    title
        A few words for a person, as ``error rate``.
    formula
        In ``TP``, ``TN``, ``FP``, ``FN`` and ``N``.
    function
        Computes it of a frame's counts, and elementwise where each count is an array. Undefined
        is NaN, as `ratio` does it.
    higher_is_better
        The direction of improvement.
    order
        Its place among the columns; the paper's metrics bear their equations' numbers.
    unit
        Of the value in tables.
    mirrors
        The metric that tells the same, as ``FNR`` for ``TPR = 1 - FNR``: a comparison shows one of
        the two.
    tabled
        Whether it is a column of the tables. One that is not is computed of sums alone.
    """

    name: str
    title: str
    formula: str
    function: Callable[[Counts], float]
    higher_is_better: bool
    order: int
    unit: str = "fraction"
    mirrors: str | None = None
    tabled: bool = True


def ratio(part: int, whole: int) -> float:
    """Divide; where the denominator is 0 the ratio is undefined: NaN, never 0 or 1."""
    try:
        return part / whole  # arrays divide nothing by nothing to NaN by themselves
    except ZeroDivisionError:
        return math.nan
