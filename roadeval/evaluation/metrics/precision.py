"""Precision."""

from roadeval.data import Counts
from roadeval.evaluation.metric import Metric, Shown, ratio


def precision(counts: Counts) -> float:
    """Compute precision, ``TP / (TP + FP)`` [1]_: undefined where no road was predicted.

    References
    ----------
    .. [1] C. J. van Rijsbergen, Information Retrieval, 2nd ed., Butterworths, 1979, chapter 7.
    """
    return ratio(counts.tp, counts.tp + counts.fp)


METRIC = Metric(
    name="precision",
    title="precision",
    formula="TP / (TP + FP)",
    function=precision,
    higher_is_better=True,
    order=103,
    shown=Shown.IN_FULL,
    tabled=False,
)
