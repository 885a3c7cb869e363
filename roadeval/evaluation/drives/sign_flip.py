"""The exact sign-flip test of a mean, and the interval that belongs to it.

Where nothing changes and the differences are as likely to be positive as negative, any of their
2^n patterns of signs is as likely as the one that was seen. The p-value is the share of the
patterns whose sum is at least as far from 0. No distribution is assumed, nor that all differences
vary alike; only that each is symmetric about the mean [1]_. The interval holds every value that the
same test does not reject when it is subtracted first [2]_.

Flipping the differences of a set ``A`` leaves a sum that is at least as great exactly where their
own sum is not above 0, so signs need not be tried: sets are counted by their sum. All 2^n of them
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

from typing import Final

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]

MOST: Final = 34
"""More values than this are not tested: the time doubles with every second one."""
_ROUNDING: Final = 1e-12
"""Sums this near to 0, in sums of the absolute values, are 0."""


def sign_flip_p(values: Values, mean: float = 0.0) -> float:
    """Compute the two-sided p-value of the hypothesis that the mean is ``mean``.

    ``p = #{s : |sum s_i (x_i - mean)| >= |sum (x_i - mean)|} / 2^n``, exactly.

    Parameters
    ----------
    values
        ``(n,)`` float64, n from 1 to `MOST`.

    Returns
    -------
    float
        A multiple of ``2^(1 - n)``, at most 1.
    """
    away = values - mean
    if away.sum() < 0:
        away = -away
    return min(float(np.ldexp(_sets_not_above_zero(away), 1 - len(away))), 1.0)


def sign_flip_interval(values: Values, confidence: float) -> tuple[float, float]:
    """Compute the values of the mean whose p-value is at least ``1 - confidence``.

    Returns
    -------
    tuple of float
        Its ends; it holds 0 exactly where `sign_flip_p` of 0 is that high. Without end in both
        directions where no pattern of signs is rare enough.
    """
    if not sign_flip_can_tell(len(values), confidence):
        return -np.inf, np.inf
    low = _lower_end(values, confidence)
    return low, -_lower_end(-values, confidence)


def sign_flip_can_tell(count: int, confidence: float) -> bool:
    """Return whether so many values can have a p-value below ``1 - confidence``: 6 for 95 %."""
    return float(np.ldexp(1.0, 1 - count)) < 1 - confidence


def _lower_end(values: Values, confidence: float) -> float:
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


def _sets_not_above_zero(values: Values) -> int:
    """Count the sets of values whose sum is 0 or less, the empty one included."""
    rounding = _ROUNDING * float(np.abs(values).sum())
    half = len(values) // 2
    first, second = _sums(values[:half]), np.sort(_sums(values[half:]))
    return int(np.searchsorted(second, rounding - np.sort(first), side="right").sum())


def _sums(values: Values) -> Values:
    """Return the sums of all sets of values, ``(2^n,)``."""
    sums = np.zeros(1)
    for value in values:
        sums = np.concatenate([sums, sums + value])
    return sums
