"""True negative rate (Eq. 28)."""

from roadeval.data import Counts
from roadeval.evaluation.metric import Metric, ratio


def true_negative_rate(counts: Counts) -> float:
    """Compute TNR, Eq. 28: ``TN / (TN + FP)``, undefined where everything is road."""
    return ratio(counts.tn, counts.tn + counts.fp)


METRIC = Metric(
    name="TNR",
    title="true negative rate",
    formula="TN / (TN + FP)",
    function=true_negative_rate,
    higher_is_better=True,
    order=28,
    mirrors="FPR",
)
