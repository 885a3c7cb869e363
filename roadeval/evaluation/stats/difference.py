"""A mean of paired differences with its interval and p-value, within one drive.

Both masks are of the same frames, so their rates are subtracted frame by frame and the differences
averaged. `roadeval.evaluation.stats.autocorrelation` computes how far the mean of a longer drive of
this kind may lie from that; the p-value of no difference comes from the same distribution, so that
an interval excludes 0 exactly where the p-value is below one minus the confidence. Over several
drives `roadeval.evaluation.stats.drives` makes the same `Difference`.

How often its intervals hold, and what they find, is in ``benchmarks/INTERVALS.md``. Drift is not
allowed for where noise hides it on a short drive, or where it takes longer than the drive: there
three or four of five intervals hold rather than nineteen of twenty.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.autocorrelation import Series, mean_distribution


@dataclass(frozen=True, slots=True)
class Difference:
    """A mean of paired differences, new minus base, with its interval. Fractions."""

    mean: float
    """NaN if no unit has a difference."""
    low: float | None
    high: float | None
    """The interval; within a drive not beyond what the base's rate leaves room for. None together
    with `p`."""
    p: float | None
    """Two-sided p-value of no difference."""
    confidence: float
    """Of the interval."""
    unit: Literal["frames", "drives"]
    """What is averaged: the frames of one drive, or the means of drives."""
    units: int
    """How many have a difference."""
    effective: float | None = None
    """Independent frames that would determine the mean as well; None without an interval, and over
    drives."""
    standard_error: float | None = None
    """Of the mean, without its skewness; None where `effective` is."""
    groups: int | None = None
    """Over drives: groups of drives, each of which counts as one."""
    worse: int | None = None
    better: int | None = None
    equal: int | None = None
    """Over drives: how many are worse, better and exactly the same."""
    needed: int | None = None
    """Units, or groups, that an interval needs; None where there is one."""
    p_holm: float | None = None
    """The p-value after Holm's correction; None where none was applied, see `holm`."""
    comparisons: int | None = None
    """How many differences were corrected for."""

    @property
    def is_zero(self) -> bool:
        """Whether it is 0 on every unit."""
        return self.low == self.high == 0

    @property
    def none_because(self) -> str:
        """Why there is no interval, as a clause; empty where there is one.

        >>> Difference(0.1, None, None, None, 0.95, "drives", 1, groups=1, needed=6).none_because
        '1 drive is too few for an interval (6 are needed)'
        """
        if self.low is not None:
            return ""
        if not self.units:
            return f"undefined on every {self.unit[:-1]}"
        count = self.units if self.groups is None else self.groups
        noun = self.unit[:-1] if count == self.units else "group of drives"
        if count != 1:
            noun = noun.replace("group", "groups") if " " in noun else f"{noun}s"
        verb = "is" if count == 1 else "are"
        return f"{count} {noun} {verb} too few for an interval ({self.needed} are needed)"


def within_drive(rates: Series, base: Series, settings: EvaluationSettings) -> Difference:
    """Average paired differences of a drive's frames, ``rates - base``, with an interval.

    Both are ``(n,)`` float64, one a frame in the drive's order; NaN where a rate is undefined,
    which leaves the frame out.
    """
    differences = rates - base
    known = ~np.isnan(differences)
    series, n = differences[known], int(known.sum())
    mean, confidence = float(series.mean()) if n else math.nan, settings.confidence
    if n < settings.least_frames:
        needed = settings.least_frames
        return Difference(mean, None, None, None, confidence, "frames", n, needed=needed)
    if np.ptp(series) == 0:
        same = float(mean == 0)
        return Difference(mean, mean, mean, same, confidence, "frames", n, float(n), 0.0)
    found = mean_distribution(series)
    low, high = found.interval(confidence)
    level = float(base[known].mean())
    low, high = max(low, -level), min(high, 1 - level)
    return Difference(
        *(mean, low, high, found.p_value(), confidence, "frames", n, found.frames, found.scale)
    )


# --- Multiple-comparison corrections of p-values --------------------------------------------------


def holm(family: Sequence[Difference]) -> list[Difference]:
    """Return differences with p-values corrected so that a false finding among them is rare.

    If no difference of the family is real, the probability that any corrected p-value is below
    ``a`` is at most ``a``, however the comparisons depend on each other [1]_. A difference without
    a p-value is not counted, nor is one that is 0 on every unit: nothing can be found there.

    References
    ----------
    .. [1] S. Holm, A Simple Sequentially Rejective Multiple Test Procedure, Scandinavian Journal
       of Statistics 6, 1979, 65-70.
    """
    tested = sorted(
        (each.p, place)
        for place, each in enumerate(family)
        if each.p is not None and not each.is_zero
    )
    found, least = list(family), 0.0
    for rank, (p, place) in enumerate(tested):
        least = max(least, min((len(tested) - rank) * p, 1.0))
        found[place] = replace(family[place], p_holm=least, comparisons=len(tested))
    return found


def benjamini_hochberg(values: Sequence[float | None]) -> list[float | None]:
    """Correct p-values so that few of the findings are false.

    Of those whose corrected value is at most ``q``, a share of at most ``q`` is false on average:
    ``min over j >= i of p_(j) m / j``, for the i-th smallest of m [1]_. That holds where the tests
    are independent, as those of different drives are, or depend on each other positively. None is
    what was not tested: it is not counted and stays None.

    References
    ----------
    .. [1] Y. Benjamini, Y. Hochberg, Controlling the False Discovery Rate, Journal of the Royal
       Statistical Society B 57, 1995, 289-300.
    """
    tested = sorted((p, place) for place, p in enumerate(values) if p is not None)
    corrected: list[float | None] = [None] * len(values)
    least = 1.0
    for rank, (p, place) in reversed([*enumerate(tested, start=1)]):
        least = min(least, p * len(tested) / rank)
        corrected[place] = least
    return corrected
