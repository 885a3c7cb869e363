"""Error rate (Eq. 25)."""

from roadeval.data import Counts
from roadeval.evaluation.metric import Metric, ratio


def error_rate(counts: Counts) -> float:
    """Compute ERR, Eq. 25: ``(FN + FP) / N``."""
    return ratio(counts.fn + counts.fp, counts.n)


METRIC = Metric(
    name="ERR",
    title="error rate",
    formula="(FN + FP) / N",
    function=error_rate,
    higher_is_better=False,
    order=25,
    rank=1,
    meaning="pixels that are wrong",
)
