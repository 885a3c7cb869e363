"""Intersection over union."""

from roadeval.data import Counts
from roadeval.evaluation.metric import Metric, ratio


def iou(counts: Counts) -> float:
    """Compute IoU, ``TP / (TP + FP + FN)``: Jaccard's index of mask and truth [1]_.

    References
    ----------
    .. [1] M. Everingham et al., The Pascal Visual Object Classes Challenge: A Retrospective,
       International Journal of Computer Vision 111, 2015, section 4.4.
    """
    return ratio(counts.tp, counts.tp + counts.fp + counts.fn)


METRIC = Metric(
    name="IoU",
    title="intersection over union",
    formula="TP / (TP + FP + FN)",
    function=iou,
    higher_is_better=True,
    order=101,
    tabled=False,
)
