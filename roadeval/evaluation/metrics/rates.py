"""The rates of a mask: the paper's six (Eq. 24-29), and three of today (IoU, F1, precision)."""

from __future__ import annotations

from typing import Final

from roadeval.data import Counts
from roadeval.evaluation.metric import Metric, Shown, ratio


def accuracy(counts: Counts) -> float:
    """Compute ACC, Eq. 24: ``(TP + TN) / N``."""
    return ratio(counts.tp + counts.tn, counts.n)


def error_rate(counts: Counts) -> float:
    """Compute ERR, Eq. 25: ``(FN + FP) / N``."""
    return ratio(counts.fn + counts.fp, counts.n)


def true_positive_rate(counts: Counts) -> float:
    """Compute TPR, Eq. 26 (printed "TRP"): ``TP / (TP + FN)``, undefined without road."""
    return ratio(counts.tp, counts.tp + counts.fn)


def false_negative_rate(counts: Counts) -> float:
    """Compute FNR, Eq. 27: ``FN / (TP + FN)``, undefined without road."""
    return ratio(counts.fn, counts.tp + counts.fn)


def true_negative_rate(counts: Counts) -> float:
    """Compute TNR, Eq. 28: ``TN / (TN + FP)``, undefined where everything is road."""
    return ratio(counts.tn, counts.tn + counts.fp)


def false_positive_rate(counts: Counts) -> float:
    """Compute FPR, Eq. 29: ``FP / (TN + FP)``, undefined where everything is road."""
    return ratio(counts.fp, counts.tn + counts.fp)


def iou(counts: Counts) -> float:
    """Compute IoU, ``TP / (TP + FP + FN)``: Jaccard's index of mask and truth [1]_.

    References
    ----------
    .. [1] M. Everingham et al., The Pascal Visual Object Classes Challenge: A Retrospective,
       International Journal of Computer Vision 111, 2015, section 4.4.
    """
    return ratio(counts.tp, counts.tp + counts.fp + counts.fn)


def f1(counts: Counts) -> float:
    """Compute F1, ``2 TP / (2 TP + FP + FN)``: the harmonic mean of precision and TPR [1]_ [2]_.

    References
    ----------
    .. [1] L. R. Dice, Measures of the Amount of Ecologic Association Between Species, Ecology
       26 (3), 1945.
    .. [2] C. J. van Rijsbergen, Information Retrieval, 2nd ed., Butterworths, 1979, chapter 7.
    """
    return ratio(2 * counts.tp, 2 * counts.tp + counts.fp + counts.fn)


def precision(counts: Counts) -> float:
    """Compute precision, ``TP / (TP + FP)`` [1]_: undefined where no road was predicted.

    References
    ----------
    .. [1] C. J. van Rijsbergen, Information Retrieval, 2nd ed., Butterworths, 1979, chapter 7.
    """
    return ratio(counts.tp, counts.tp + counts.fp)


METRICS: Final = (
    Metric(
        name="ACC",
        title="accuracy",
        formula="(TP + TN) / N",
        function=accuracy,
        higher_is_better=True,
        order=24,
        rank=4,
        mirrors="ERR",
        shown=Shown.IN_FULL,
    ),
    Metric(
        name="ERR",
        title="error rate",
        formula="(FN + FP) / N",
        function=error_rate,
        higher_is_better=False,
        order=25,
        rank=1,
        meaning="pixels that are wrong",
    ),
    Metric(
        name="TPR",
        title="true positive rate",
        formula="TP / (TP + FN)",
        function=true_positive_rate,
        higher_is_better=True,
        order=26,
        mirrors="FNR",
    ),
    Metric(
        name="FNR",
        title="false negative rate",
        formula="FN / (TP + FN)",
        function=false_negative_rate,
        higher_is_better=False,
        order=27,
        rank=3,
        meaning="road not found",
    ),
    Metric(
        name="TNR",
        title="true negative rate",
        formula="TN / (TN + FP)",
        function=true_negative_rate,
        higher_is_better=True,
        order=28,
        mirrors="FPR",
    ),
    Metric(
        name="FPR",
        title="false positive rate",
        formula="FP / (TN + FP)",
        function=false_positive_rate,
        higher_is_better=False,
        order=29,
        rank=2,
        meaning="non-road called road",
    ),
    Metric(
        name="IoU",
        title="intersection over union",
        formula="TP / (TP + FP + FN)",
        function=iou,
        higher_is_better=True,
        order=101,
        tabled=False,
    ),
    Metric(
        name="F1",
        title="F1",
        formula="2 TP / (2 TP + FP + FN)",
        function=f1,
        higher_is_better=True,
        order=102,
        shown=Shown.IN_FULL,
        tabled=False,
    ),
    Metric(
        name="precision",
        title="precision",
        formula="TP / (TP + FP)",
        function=precision,
        higher_is_better=True,
        order=103,
        shown=Shown.IN_FULL,
        tabled=False,
    ),
)
