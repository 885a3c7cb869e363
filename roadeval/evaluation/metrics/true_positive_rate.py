"""True positive rate (Eq. 26)."""

from roadeval.data import Counts
from roadeval.evaluation.metric import Metric, ratio


def true_positive_rate(counts: Counts) -> float:
    """Compute TPR, Eq. 26 (printed "TRP"): ``TP / (TP + FN)``, undefined without road."""
    return ratio(counts.tp, counts.tp + counts.fn)


METRIC = Metric(
    name="TPR",
    title="true positive rate",
    formula="TP / (TP + FN)",
    function=true_positive_rate,
    higher_is_better=True,
    order=26,
    mirrors="FNR",
)
