"""Accuracy (Eq. 24)."""

from roadeval.data import Counts
from roadeval.evaluation.metric import Metric, Shown, ratio


def accuracy(counts: Counts) -> float:
    """Compute ACC, Eq. 24: ``(TP + TN) / N``."""
    return ratio(counts.tp + counts.tn, counts.n)


METRIC = Metric(
    name="ACC",
    title="accuracy",
    formula="(TP + TN) / N",
    function=accuracy,
    higher_is_better=True,
    order=24,
    rank=4,
    mirrors="ERR",
    shown=Shown.IN_FULL,
)
