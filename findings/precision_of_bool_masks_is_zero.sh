#!/usr/bin/env bash
# MONAI's precision, recall and F1 of masks of True and False are 0, where its Dice is right.
#
# Software: monai 1.6.1 with torch 2.14.1; numpy 2.4.6.
#
# A prediction and a truth are masks of True and False, such as `probability > 0.5` returns.
# `DiceMetric`, `MeanIoU`, `compute_hausdorff_distance` and the other scores of MONAI take them and
# are right. `ConfusionMatrixMetric` and `get_confusion_matrix` take them, too, and find no true
# positive: the hits are where prediction + truth == 2, and True + True of PyTorch is True, which is
# 1. All hits are counted as misses. A prediction that has nine of ten pixels right has a precision,
# sensitivity, F1 and threat score (IoU) of 0.0, and an accuracy of 0.44; a perfect one has a
# sensitivity of 0. Specificity and the false positives are right, so a table has some plausible
# numbers beside the zeros, and where a model is new the zeros look like one that finds nothing. If
# one of the two masks is of another type, all is right, which hides it from a test with
# `mask.float()`.
#
# `mask.int()` before the metric mends it.
#
# Source: the documentation of `get_confusion_matrix` and `ConfusionMatrixMetric` asks for binarised
# values and names no type; `tp = (y_pred + y) == 2` in monai/metrics/confusion_matrix.py.
# (The script downloads some gigabytes.)
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  torch==2.14.1 monai==1.6.1 numpy==2.4.6
"$folder/venv/bin/python" -W ignore - <<'PYTHON'
import monai
import numpy as np
import torch
from monai.metrics import (
    ConfusionMatrixMetric,
    DiceMetric,
    compute_confusion_matrix_metric,
    compute_iou,
    get_confusion_matrix,
)

random = np.random.default_rng(0)
truth = random.random((1, 1, 48, 64)) < 0.5
predicted = truth ^ (random.random(truth.shape) < 0.1)
hits, false = (predicted & truth).sum(), (predicted & ~truth).sum()
empty, missed = (~predicted & ~truth).sum(), (~predicted & truth).sum()
right = {
    "precision": hits / (hits + false),
    "sensitivity": hits / (hits + missed),
    "f1 score": 2 * hits / (2 * hits + false + missed),
    "threat score": hits / (hits + false + missed),
    "accuracy": (hits + empty) / truth.size,
    "specificity": empty / (empty + false),
}
print(f"monai {monai.__version__}, torch {torch.__version__}")
print("  by numpy:", {name: round(float(score), 3) for name, score in right.items()})


def scores(*masks):
    counts = get_confusion_matrix(*masks)
    names = [compute_confusion_matrix_metric(name, counts) for name in right]
    return counts.flatten().tolist(), dict(zip(right, [float(n) for n in names], strict=True))


masks = torch.tensor(predicted), torch.tensor(truth)
for kind in (torch.bool, torch.uint8, torch.int64, torch.float32):
    counts, found = scores(*(mask.to(kind) for mask in masks))
    print(f"  {kind}:", {name: round(score, 3) for name, score in found.items()})
    if kind == torch.bool:
        assert counts == [0, false, empty, missed + hits]
        assert all(found[n] == 0 for n in ("precision", "sensitivity", "f1 score", "threat score"))
        assert found["accuracy"] < 0.5
        assert np.isclose(found["specificity"], right["specificity"])
    else:
        assert counts == [hits, false, empty, missed]
        assert all(np.isclose(found[name], right[name]) for name in right)

mixed = scores(masks[0], masks[1].float())[1]
assert np.isclose(mixed["precision"], right["precision"])
perfect = scores(masks[1], masks[1])[1]
print(f"  a perfect prediction of True and False: sensitivity {perfect['sensitivity']:.3f}")
assert np.isnan(perfect["precision"])
assert perfect["sensitivity"] == 0

metric = ConfusionMatrixMetric(metric_name=["precision", "f1 score"])
metric(*masks)
assert [float(score) for score in metric.aggregate()] == [0, 0]
dice = DiceMetric(reduction="mean")
dice(*masks)
whole, part = float(dice.aggregate()), float(compute_iou(*masks))
print(f"  the same masks by DiceMetric: {whole:.3f}, by compute_iou: {part:.3f}")
assert np.isclose(whole, right["f1 score"])
assert np.isclose(part, right["threat score"])
PYTHON
