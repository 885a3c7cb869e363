"""A mean of differences over drives, with its interval and p-value; and parts of a fleet.

The unit is the group of drives: a group's drives are averaged first, and every group counts alike.
Below 30 groups p-value and interval are those of the exact sign-flip test, from there on Student's.

How often its intervals hold, and what they find, is in ``benchmarks/INTERVALS.md``.

From ten groups on, the sign-flip test and Student's hold equally often. With six, sign flip's
interval reaches from the least to the greatest mean, which is wider, finds less, and holds more
often where drives are skewed. It is used because it needs no normal distribution, nor drives that
vary alike.

Where nothing changes and the differences are as likely to be positive as negative, any of their
2^n patterns of signs is as likely as the one that was seen. The p-value is the share of the
patterns whose sum is at least as far from 0. No distribution is assumed, nor that all differences
vary alike; only that each is symmetric about the mean [1]_. The interval holds every value that the
same test does not reject when it is subtracted first [2]_.

Flipping the differences of a set ``A`` leaves a sum that is at least as great exactly where their
own sum is not above 0, so sets are counted by their sum instead of signs tried. All 2^n of them
are, also where they are too many to list, as pairs of one half's sets and the other's [3]_.

References
----------
.. [1] R. A. Fisher, The Design of Experiments, 1935, section 21.
.. [2] J. A. Hartigan, Using Subsample Values as Typical Values, Journal of the American
   Statistical Association 64, 1969, 1303-1317.
.. [3] E. Horowitz, S. Sahni, Computing Partitions with Applications to the Knapsack Problem,
   Journal of the ACM 21, 1974, 277-292.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from roadeval.data.arrays import Floats
from roadeval.evaluation.stats.autocorrelation import Difference, holm

LEAST_GROUPS: Final = 6
"""Groups that an interval needs. With five, the least two-sided p-value of a sign-flip test is
1/16, so none can be found to differ at 95 %."""
STUDENT_FROM: Final = 30
"""With fewer groups than this the interval is that of the exact sign-flip test, from it on
Student's, which takes the mean for normal."""
_ROUNDING: Final = 1e-12
"""Sums this near to 0, in sums of the absolute values, are 0."""


@dataclass(frozen=True)
class DriveMean:
    """The mean difference of a rate on one drive, new minus base."""

    drive: str
    group: str
    """A name shared with other drives, as of a day or a route; its own identity without one."""
    mean: float
    """NaN if no frame has a difference: the drive is left out."""


def group_means(drives: Iterable[DriveMean]) -> Floats:
    """Return the mean of each group's drives, ``(g,)``, for any order of the drives."""
    known = sorted(
        (each for each in drives if not np.isnan(each.mean)),
        key=lambda each: (each.group, each.drive),
    )
    if not known:
        return np.zeros(0)
    _, sizes = np.unique([each.group for each in known], return_counts=True)
    sums = np.add.reduceat(np.array([each.mean for each in known]), np.cumsum(sizes) - sizes)
    means: Floats = sums / sizes
    return means


def over_drives(
    drives: Sequence[DriveMean], confidence: float, *, higher_is_better: bool = False
) -> Difference:
    """Average the differences of drives, in any order, with an interval.

    Examples
    --------
    >>> drives = [DriveMean(name, name, mean)
    ...           for name, mean in zip("abcdef", [0.01, 0.02, 0.02, 0.03, 0.05, -0.01])]
    >>> found = over_drives(drives, 0.95)
    >>> round(found.mean, 3), found.low, found.high, found.p, found.worse
    (0.02, -0.01, 0.05, 0.09375, 5)
    """
    known = [each.mean for each in drives if not math.isnan(each.mean)]
    rises, falls = sum(mean > 0 for mean in known), sum(mean < 0 for mean in known)
    means = group_means(drives)
    # Below that, no sign flip is rare enough.
    enough = (n for n in range(LEAST_GROUPS, STUDENT_FROM) if sign_flip_can_tell(n, confidence))
    needed = next(enough, STUDENT_FROM)
    low = high = p = None
    if len(means) >= STUDENT_FROM:
        low, high, p = _student(means, confidence)
    elif len(means) >= needed:
        low, high, p = *sign_flip_interval(means, confidence), sign_flip_p(means)
    return Difference(
        mean=float(means.mean()) if known else math.nan,
        low=low,
        high=high,
        p=p,
        confidence=confidence,
        unit="drives",
        units=len(known),
        groups=len(means),
        worse=falls if higher_is_better else rises,
        better=rises if higher_is_better else falls,
        equal=len(known) - rises - falls,
        needed=needed if low is None else None,
    )


def _student(means: Floats, confidence: float) -> tuple[float, float, float]:
    """Return Student's interval of a mean, and the p-value of 0."""
    mean, degrees = float(means.mean()), len(means) - 1
    if np.ptp(means) == 0:
        return mean, mean, float(mean == 0)
    error = float(means.std(ddof=1)) / math.sqrt(len(means))
    from scipy.special import stdtr, stdtrit

    half = float(stdtrit(degrees, (1 + confidence) / 2)) * error
    return mean - half, mean + half, float(2 * stdtr(degrees, -abs(mean) / error))


def sign_flip_p(values: Floats, mean: float = 0.0) -> float:
    """Compute the two-sided p-value of the hypothesis that the mean is ``mean``.

    ``p = #{s : |sum s_i (x_i - mean)| >= |sum (x_i - mean)|} / 2^n``, exactly; the time doubles
    with every second value. ``values`` are ``(n,)`` float64, n at least 1; the p-value is a
    multiple of ``2^(1 - n)``.
    """
    away = values - mean
    if away.sum() < 0:
        away = -away
    return min(float(np.ldexp(_sets_not_above_zero(away), 1 - len(away))), 1.0)


def sign_flip_interval(values: Floats, confidence: float) -> tuple[float, float]:
    """Compute the values of the mean whose p-value is at least ``1 - confidence``.

    `sign_flip_can_tell` must hold. Returned are the interval's ends; it holds 0 exactly where
    `sign_flip_p` of 0 is that high.
    """
    return _lower_end(values, confidence), -_lower_end(-values, confidence)


def sign_flip_can_tell(count: int, confidence: float) -> bool:
    """Return whether so many values can have a p-value below ``1 - confidence``: 6 for 95 %."""
    return float(np.ldexp(1.0, 1 - count)) < 1 - confidence


def _lower_end(values: Floats, confidence: float) -> float:
    """Return the least mean that is not rejected, by halves: 1e-8 of the way at most above it.

    The smallest value is it, or below it: there only the empty set counts. 0 is tried first, so
    that no rounding puts an end on its other side.
    """
    low, high = float(values.min()), float(values.mean())
    precision = 1e-8 * (high - low)
    if sign_flip_p(values, low) >= 1 - confidence:
        return low
    middle = 0.0 if low < 0 < high else (low + high) / 2
    while high - low > precision:
        rejected = sign_flip_p(values, middle) < 1 - confidence
        low, high = (middle, high) if rejected else (low, middle)
        middle = (low + high) / 2
    return high


def _sets_not_above_zero(values: Floats) -> int:
    """Count the sets of values whose sum is 0 or less, the empty one included."""
    rounding = _ROUNDING * float(np.abs(values).sum())
    half = len(values) // 2
    first, second = _sums(values[:half]), np.sort(_sums(values[half:]))
    return int(np.searchsorted(second, rounding - np.sort(first), side="right").sum())


def _sums(values: Floats) -> Floats:
    """Return the sums of all sets of values, ``(2^n,)``."""
    sums = np.zeros(1)
    for value in values:
        sums = np.concatenate([sums, sums + value])
    return sums


def strata(
    drives: Sequence[DriveMean], tags: Mapping[str, Sequence[str | None]], confidence: float
) -> Iterator[tuple[str, str, Difference]]:
    """Divide drives by each tag, and average every part.

    Yielded are the tag, its value and the difference on the drives that have it; p-values are
    corrected together. ``tags`` are by name each drive's value, in the order of ``drives``; None
    where it has none, which leaves the drive out of this division. A tag that does not divide the
    drives makes no parts. Drives without a mean are left out.
    """
    parts: dict[tuple[str, str], list[DriveMean]] = {}
    for by, values in tags.items():
        pairs = zip(values, drives, strict=True)
        known = [(value, each) for value, each in pairs if not math.isnan(each.mean)]
        names = sorted({value for value, _ in known if value is not None})
        if len(names) > 1 or any(value is None for value, _ in known):
            parts |= {(by, name): [e for value, e in known if value == name] for name in names}
    found = holm([over_drives(own, confidence) for own in parts.values()])
    yield from ((*part, each) for part, each in zip(parts, found, strict=True))
