"""The rates of a mask: the paper's six (Eq. 24-29), and IoU, mIoU, F1, precision.

IoU is Jaccard's index of mask and truth [1]_, mIoU its mean over road and non-road; F1 the
harmonic mean of precision and TPR [2]_ [3]_.

References
----------
.. [1] M. Everingham et al., The Pascal Visual Object Classes Challenge: A Retrospective,
   International Journal of Computer Vision 111, 2015, section 4.4.
.. [2] L. R. Dice, Measures of the Amount of Ecologic Association Between Species, Ecology
   26 (3), 1945.
.. [3] C. J. van Rijsbergen, Information Retrieval, 2nd ed., Butterworths, 1979, chapter 7.
"""

from __future__ import annotations

from typing import Final

from roadeval.evaluation.metric import Metric, Shown, ratio

METRICS: Final = (
    Metric(  # Eq. 24
        name="ACC",
        title="accuracy",
        formula="(TP + TN) / N",
        function=lambda c: ratio(c.tp + c.tn, c.n),
        higher_is_better=True,
        order=24,
        rank=4,
        shown=Shown.IN_FULL,
    ),
    Metric(  # Eq. 25
        name="ERR",
        title="error rate",
        formula="(FN + FP) / N",
        function=lambda c: ratio(c.fn + c.fp, c.n),
        higher_is_better=False,
        order=25,
        rank=1,
        meaning="pixels that are wrong",
    ),
    Metric(  # Eq. 26, printed "TRP"; undefined without road, as is Eq. 27
        name="TPR",
        title="true positive rate",
        formula="TP / (TP + FN)",
        function=lambda c: ratio(c.tp, c.tp + c.fn),
        higher_is_better=True,
        order=26,
        shown=Shown.IN_FILES,
    ),
    Metric(  # Eq. 27
        name="FNR",
        title="false negative rate",
        formula="FN / (TP + FN)",
        function=lambda c: ratio(c.fn, c.tp + c.fn),
        higher_is_better=False,
        order=27,
        rank=3,
        meaning="road not found",
    ),
    Metric(  # Eq. 28; undefined if everything is road, like Eq. 29
        name="TNR",
        title="true negative rate",
        formula="TN / (TN + FP)",
        function=lambda c: ratio(c.tn, c.tn + c.fp),
        higher_is_better=True,
        order=28,
        shown=Shown.IN_FILES,
    ),
    Metric(  # Eq. 29
        name="FPR",
        title="false positive rate",
        formula="FP / (TN + FP)",
        function=lambda c: ratio(c.fp, c.tn + c.fp),
        higher_is_better=False,
        order=29,
        rank=2,
        meaning="non-road called road",
    ),
    Metric(
        name="IoU",
        title="intersection over union",
        formula="TP / (TP + FP + FN)",
        function=lambda c: ratio(c.tp, c.tp + c.fp + c.fn),
        higher_is_better=True,
        order=101,
        tabled=False,
    ),
    Metric(
        name="mIoU",
        title="mean IoU of road and non-road",
        formula="(TP / (TP + FP + FN) + TN / (TN + FP + FN)) / 2",
        function=lambda c: (ratio(c.tp, c.tp + c.fp + c.fn) + ratio(c.tn, c.tn + c.fp + c.fn)) / 2,
        higher_is_better=True,
        order=102,
        shown=Shown.IN_FULL,
        tabled=False,
    ),
    Metric(
        name="F1",
        title="F1",
        formula="2 TP / (2 TP + FP + FN)",
        function=lambda c: ratio(2 * c.tp, 2 * c.tp + c.fp + c.fn),
        higher_is_better=True,
        order=103,
        shown=Shown.IN_FULL,
        tabled=False,
    ),
    Metric(
        name="precision",
        title="precision",
        formula="TP / (TP + FP)",
        function=lambda c: ratio(c.tp, c.tp + c.fp),
        higher_is_better=True,
        order=104,
        shown=Shown.IN_FULL,
        tabled=False,
    ),
)
