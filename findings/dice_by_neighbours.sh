#!/usr/bin/env bash
# torchmetrics' GeneralizedDiceScore of one frame is 0.999 or 0.012, by the frame that stands before it.
#
# Software: torchmetrics 1.9.0 with torch 2.13.0 and numpy 2.4.6.
#
# Each frame's score is weighed by the sizes of its own classes: a class of n pixels has the weight
# 1/n^2. A class that the frame does not have would weigh infinitely much. It gets the largest weight
# that a frame of its batch has, and that of another class, as the index is wrong. In the example a
# frame has a road and no car, and eight of its pixels are called a car by mistake. Alone it has a score
# of 0.999. In a batch with a frame that has a small car, it has 0.997 as the first of the two and
# 0.012 as the second. So the score of a drive depends on the size of the batches and on the order of
# the frames: that of twelve frames is 0.999 for batches of one, 0.75 for one batch, and 0.83 for the
# same batch backwards. With a loader that shuffles, two runs on one network differ. Data in which
# every frame has every class do not show it.
#
# Batches of one frame, `weight_type="linear"` and `DiceScore` have one value each.
#
# Source: `w_max` in torchmetrics/functional/segmentation/generalized_dice.py is a maximum over the batch,
# laid out class by class, and read frame by frame. The documentation has a formula for one frame, and
# says nothing of the batch. Issue 2846 of Lightning-AI/torchmetrics, open, is about the scores of a
# class that a frame has not.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  torchmetrics==1.9.0 torch==2.13.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
from importlib.metadata import version

import torch
from torchmetrics.functional.segmentation import generalized_dice_score
from torchmetrics.segmentation import DiceScore, GeneralizedDiceScore

GROUND, ROAD, CAR = range(3)
FORM = {"num_classes": 3, "input_format": "index"}


def frame(car=None):
    """Return a frame as it is predicted and as it is: a road, and a car of some size or none."""
    truth = torch.full((48, 64), GROUND)
    truth[20:, 8:56] = ROAD
    if car:
        truth[20 : 20 + car[0], 20 : 20 + car[1]] = CAR
    predicted = truth.clone()
    if not car:
        predicted[10:12, 10:14] = CAR
    return predicted, truth


def by_formula(predicted, truth):
    """Return the score of one frame, by the documented formula, a class it has not left out."""
    sums = [0.0, 0.0]
    for kind in range(3):
        size = (truth == kind).sum().item()
        if size:
            sums[0] += 2 * ((truth == kind) & (predicted == kind)).sum().item() / size**2
            sums[1] += (size + (predicted == kind).sum().item()) / size**2
    return sums[0] / sums[1]


def scores(frames, **options):
    return generalized_dice_score(*(torch.stack(part) for part in zip(*frames)), **FORM, **options)


print(f"torchmetrics {version('torchmetrics')}, PyTorch {torch.__version__.split('+')[0]}")
empty, small, large = frame(), frame((2, 3)), frame((20, 20))
places = {
    "alone": ([empty], 0),
    "before a frame with a small car": ([empty, small], 0),
    "behind it": ([small, empty], 1),
    "behind one with a large car": ([large, empty], 1),
}
found = {}
for words, (frames, place) in places.items():
    found[words] = scores(frames)[place].item()
    linear = scores(frames, weight_type="linear")[place].item()
    print(f"  the frame without a car, {words}: {found[words]:.4f} (by linear weights {linear:.4f})")
    assert abs(linear - 0.9974) < 1e-4
print(f"  by the formula {by_formula(*empty):.4f}")
assert abs(by_formula(*empty) - found["alone"]) < 1e-2
assert found["alone"] > 0.99 and found["behind it"] < 0.02
assert found["before a frame with a small car"] > 0.99 and 0.97 < found["behind one with a large car"] < 0.99

drive = [small, empty, empty, large, empty, empty] * 2


def mean(metric, frames, size):
    for start in range(0, len(frames), size):
        metric.update(*(torch.stack(part) for part in zip(*frames[start : start + size])))
    return metric.compute().item()


print(f"  {len(drive)} frames as one drive")
means = []
for words, frames in (("as recorded", drive), ("backwards", drive[::-1])):
    for size in (1, 2, 3, 4, 12):
        means.append(mean(GeneralizedDiceScore(**FORM), frames, size))
        dice = mean(DiceScore(**FORM, average="macro"), frames, size)
        print(f"    {words}, {size} a batch: {means[-1]:.4f}, DiceScore {dice:.4f}")
        assert abs(dice - mean(DiceScore(**FORM, average="macro"), drive, 1)) < 1e-5
assert abs(means[0] - means[5]) < 1e-6
assert max(means) - min(means) > 0.2
PYTHON
