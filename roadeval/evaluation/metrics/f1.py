"""F1 score."""

from roadeval.data import Counts
from roadeval.evaluation.metric import Metric, Shown, ratio


def f1(counts: Counts) -> float:
    """Compute F1, ``2 TP / (2 TP + FP + FN)``: the harmonic mean of precision and TPR [1]_ [2]_.

    References
    ----------
    .. [1] L. R. Dice, Measures of the Amount of Ecologic Association Between Species, Ecology
       26 (3), 1945.
    .. [2] C. J. van Rijsbergen, Information Retrieval, 2nd ed., Butterworths, 1979, chapter 7.
    """
    return ratio(2 * counts.tp, 2 * counts.tp + counts.fp + counts.fn)


METRIC = Metric(
    name="F1",
    title="F1",
    formula="2 TP / (2 TP + FP + FN)",
    function=f1,
    higher_is_better=True,
    order=102,
    shown=Shown.IN_FULL,
    tabled=False,
)
