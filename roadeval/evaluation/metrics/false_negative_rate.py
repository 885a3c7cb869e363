"""False negative rate (Eq. 27)."""

from roadeval.data import Counts
from roadeval.evaluation.metric import Metric, ratio


def false_negative_rate(counts: Counts) -> float:
    """Compute FNR, Eq. 27: ``FN / (TP + FN)``, undefined without road."""
    return ratio(counts.fn, counts.tp + counts.fn)


METRIC = Metric(
    name="FNR",
    title="false negative rate",
    formula="FN / (TP + FN)",
    function=false_negative_rate,
    higher_is_better=False,
    order=27,
    rank=3,
    meaning="road not found",
)
