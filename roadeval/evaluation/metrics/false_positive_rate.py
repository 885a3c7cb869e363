"""False positive rate (Eq. 29)."""

from roadeval.data import Counts
from roadeval.evaluation.metric import Metric, ratio


def false_positive_rate(counts: Counts) -> float:
    """Compute FPR, Eq. 29: ``FP / (TN + FP)``, undefined where everything is road."""
    return ratio(counts.fp, counts.tn + counts.fp)


METRIC = Metric(
    name="FPR",
    title="false positive rate",
    formula="FP / (TN + FP)",
    function=false_positive_rate,
    higher_is_better=False,
    order=29,
    rank=2,
    meaning="non-road called road",
)
