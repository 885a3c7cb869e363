#!/usr/bin/env bash
# scikit-learn's `labels=[0, 1]` leaves void pixels out of one score and counts them in another.
#
# Software: scikit-learn 1.9.1, with numpy 2.4.6.
#
# The truth of a frame has road (1), other ground (0) and void (255: the sky and the car's bonnet),
# and a network predicts 0 or 1 everywhere. `labels=[0, 1]` is to leave void out. `confusion_matrix`
# and `cohen_kappa_score` do: they drop each pixel whose truth or prediction is another class.
# `jaccard_score`, `precision_score`, `f1_score`, `classification_report` and
# `multilabel_confusion_matrix` drop no pixel. There the same argument says which classes are
# reported, and a road that is predicted on void is false road. One frame has an IoU of road of 0.9000
# by the confusion matrix and of 0.6171 by `jaccard_score`. The report looks as if void were left
# out, as its column `support` has only the 3,200 valid pixels, but its precision is 0.6626 where the
# valid pixels alone have 1.0000. Its recall is right.
#
# The matrix has a fault of its own where a network may predict void: a road pixel that it calls
# void is dropped, too, and is no miss. The other scores count it.
#
# To drop the pixels whose truth is void oneself, or to weigh them by 0 (`sample_weight`), gives one
# value by all of them.
#
# Source: the scores of one frame. The documentation says of `labels` that it may "select a subset of
# labels" (confusion_matrix) and that labels "can be excluded" (jaccard_score), and of neither what
# becomes of the pixels that have the other labels.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  scikit-learn==1.9.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import sklearn
from sklearn.metrics import (
    classification_report,
    cohen_kappa_score,
    confusion_matrix,
    f1_score,
    jaccard_score,
    multilabel_confusion_matrix,
    precision_score,
    recall_score,
)

VOID, CLASSES = 255, [0, 1]
truth = np.zeros((60, 80), int)
truth[20:50] = 1  # road
truth[:10] = VOID  # the sky
truth[50:] = VOID  # the bonnet
predicted = np.zeros_like(truth)
predicted[23:50] = 1
predicted[50:, 10:70] = 1  # most of the bonnet is taken for road, ...
predicted[:10, :50] = 1  # ... and some of the sky
truth, predicted = truth.ravel(), predicted.ravel()
valid = truth != VOID


def of_road(score, truth, predicted, **weights):
    return round(score(truth, predicted, labels=CLASSES, average=None, **weights)[1], 4)


def iou_by_matrix(truth, predicted, **weights):
    matrix = confusion_matrix(truth, predicted, labels=CLASSES, **weights)
    return round(matrix[1, 1] / (matrix.sum() - matrix[0, 0]), 4)


def kappa(truth, predicted):
    return cohen_kappa_score(truth, predicted, labels=CLASSES)


print(f"scikit-learn {sklearn.__version__}; {valid.sum()} pixels are valid, {(~valid).sum()} void")
by_matrix, by_score = iou_by_matrix(truth, predicted), of_road(jaccard_score, truth, predicted)
print(f"labels={CLASSES}: IoU {by_matrix} by confusion_matrix, {by_score} by jaccard_score")
assert (by_matrix, by_score) == (0.9, 0.6171)
assert confusion_matrix(truth, predicted, labels=CLASSES).sum() == valid.sum()
assert multilabel_confusion_matrix(truth, predicted, labels=CLASSES)[1].sum() == truth.size
assert kappa(truth, predicted) == kappa(truth[valid], predicted[valid])

report = classification_report(truth, predicted, labels=CLASSES, output_dict=True)
print(f"the report: {report['1']}")
assert report["0"]["support"] + report["1"]["support"] == valid.sum()
assert round(report["1"]["precision"], 4) == of_road(precision_score, truth, predicted) == 0.6626
assert round(report["1"]["f1-score"], 4) == of_road(f1_score, truth, predicted)
assert round(report["1"]["recall"], 4) == of_road(recall_score, truth, predicted) == 0.9

kept = truth[valid], predicted[valid]
for name, score in (("precision", precision_score), ("IoU", jaccard_score)):
    values = of_road(score, *kept), of_road(score, truth, predicted, sample_weight=valid)
    print(f"without the void pixels: {name} {values[0]}; with the weight 0 for them: {values[1]}")
    assert values == ((1, 1) if score is precision_score else (0.9, 0.9))
assert iou_by_matrix(*kept) == iou_by_matrix(truth, predicted, sample_weight=valid) == 0.9

unsure = np.where(predicted[valid] == truth[valid], predicted[valid], VOID)
by_matrix, by_score = iou_by_matrix(kept[0], unsure), of_road(jaccard_score, kept[0], unsure)
print(f"missed road predicted as void: IoU {by_matrix} by the matrix, {by_score} by jaccard_score")
assert (by_matrix, by_score) == (1, 0.9)
PYTHON
