"""Multiple-comparison corrections of p-values."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate


def holm_p_values(values: Sequence[float | None]) -> list[float | None]:
    """Correct p-values so that a false finding among them is rare.

    If nothing is true in a family, the probability that any corrected value is below ``a`` is at
    most ``a``, however the comparisons depend on each other [1]_.

    Parameters
    ----------
    values
        None for what was not tested, which is not counted and stays None.

    References
    ----------
    .. [1] S. Holm, A Simple Sequentially Rejective Multiple Test Procedure, Scandinavian Journal
       of Statistics 6, 1979, 65-70.
    """
    tested = {place: p for place, p in enumerate(values) if p is not None}
    corrected: list[float | None] = [None] * len(values)
    least = 0.0
    for rank, place in enumerate(sorted(tested, key=tested.__getitem__)):
        least = max(least, min((len(tested) - rank) * tested[place], 1.0))
        corrected[place] = least
    return corrected


def benjamini_hochberg(values: Sequence[float | None]) -> list[float | None]:
    """Correct p-values so that few of the findings are false.

    Of those whose corrected value is at most ``q``, a share of at most ``q`` is false on average:
    ``min over j >= i of p_(j) m / j``, for the i-th smallest of m [1]_. That holds where the tests
    are independent, as those of different drives are, or depend on each other positively.

    Parameters
    ----------
    values
        None for what was not tested, which is not counted and stays None.

    References
    ----------
    .. [1] Y. Benjamini, Y. Hochberg, Controlling the False Discovery Rate, Journal of the Royal
       Statistical Society B 57, 1995, 289-300.
    """
    tested = {place: p for place, p in enumerate(values) if p is not None}
    order = sorted(tested, key=tested.__getitem__)
    scaled = [tested[place] * len(order) / rank for rank, place in enumerate(order, start=1)]
    least = list(accumulate(reversed(scaled), min))[::-1]
    corrected: list[float | None] = [None] * len(values)
    for place, p in zip(order, least, strict=True):
        corrected[place] = min(p, 1.0)
    return corrected
