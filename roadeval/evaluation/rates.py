"""Rates from counts: the paper's six (Eq. 24-29) and those a reader of today expects.

Every rate is a fraction. One whose denominator is 0 is undefined: NaN, never 0 or 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Counts


def accuracy(counts: Counts) -> float:
    """ACC, Eq. 24: ``(TP + TN) / N``."""
    return _ratio(counts.tp + counts.tn, counts.n)


def error_rate(counts: Counts) -> float:
    """ERR, Eq. 25: ``(FN + FP) / N``."""
    return _ratio(counts.fn + counts.fp, counts.n)


def true_positive_rate(counts: Counts) -> float:
    """TPR, Eq. 26 (printed "TRP"): ``TP / (TP + FN)``, undefined without road."""
    return _ratio(counts.tp, counts.tp + counts.fn)


def false_negative_rate(counts: Counts) -> float:
    """FNR, Eq. 27: ``FN / (TP + FN)``, undefined without road."""
    return _ratio(counts.fn, counts.tp + counts.fn)


def true_negative_rate(counts: Counts) -> float:
    """TNR, Eq. 28: ``TN / (TN + FP)``, undefined where everything is road."""
    return _ratio(counts.tn, counts.tn + counts.fp)


def false_positive_rate(counts: Counts) -> float:
    """FPR, Eq. 29: ``FP / (TN + FP)``, undefined where everything is road."""
    return _ratio(counts.fp, counts.tn + counts.fp)


def precision(counts: Counts) -> float:
    """Precision, ``TP / (TP + FP)`` [1]_: undefined where no road was predicted.

    References
    ----------
    .. [1] C. J. van Rijsbergen, Information Retrieval, 2nd ed., Butterworths, 1979, chapter 7.
    """
    return _ratio(counts.tp, counts.tp + counts.fp)


def f1(counts: Counts) -> float:
    """F1, ``2 TP / (2 TP + FP + FN)``: the harmonic mean of precision and TPR [1]_ [2]_.

    References
    ----------
    .. [1] L. R. Dice, Measures of the Amount of Ecologic Association Between Species, Ecology
       26 (3), 1945.
    .. [2] C. J. van Rijsbergen, Information Retrieval, 2nd ed., Butterworths, 1979, chapter 7.
    """
    return _ratio(2 * counts.tp, 2 * counts.tp + counts.fp + counts.fn)


def iou(counts: Counts) -> float:
    """IoU, ``TP / (TP + FP + FN)``: Jaccard's index of mask and truth [1]_.

    References
    ----------
    .. [1] M. Everingham et al., The Pascal Visual Object Classes Challenge: A Retrospective,
       International Journal of Computer Vision 111, 2015, section 4.4.
    """
    return _ratio(counts.tp, counts.tp + counts.fp + counts.fn)


Rate = Callable[[Counts], float]

RATES: Final[Mapping[str, Rate]] = {
    "ACC": accuracy,
    "ERR": error_rate,
    "TPR": true_positive_rate,
    "FNR": false_negative_rate,
    "TNR": true_negative_rate,
    "FPR": false_positive_rate,
}
"""The paper's six by their names there, in the order of the tables' columns."""

OVERLAP_RATES: Final[Mapping[str, Rate]] = {"IoU": iou, "F1": f1, "precision": precision}
"""Rates beyond the paper's, which are in no table of frames."""


def of(counts: Counts) -> dict[str, float]:
    """Compute the paper's six rates."""
    return {name: rate(counts) for name, rate in RATES.items()}


def table(counts: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """Compute the paper's six rates of many frames at once, exactly as `of` does.

    Parameters
    ----------
    counts
        ``(n, 4)``: TP, TN, FP, FN.

    Returns
    -------
    array
        ``(n, 6)`` float64 in the order of `RATES`; NaN where a rate is undefined.
    """
    columns = Counts(*counts.T)
    with np.errstate(invalid="ignore"):
        return np.stack([rate(columns) for rate in RATES.values()], axis=1)


def _ratio(part: int, whole: int) -> float:
    try:
        return part / whole  # of arrays, `table`'s, nothing by nothing is NaN as it is
    except ZeroDivisionError:
        return math.nan
