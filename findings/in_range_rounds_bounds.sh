#!/usr/bin/env bash
# OpenCV's `inRange` of a label image from 0.5 to 1.5 has the classes 0, 1 and 2, not class 1 alone.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, with numpy 2.4.6.
#
# To take one class out of a label image, its neighbours are kept out by bounds half-way between two
# classes: `cv2.inRange(labels, 0.5, 1.5)`. For images of whole numbers `inRange` first rounds both
# bounds to whole numbers, and halves to the even one, so this asks for 0 to 2. In the example all
# 153,600 pixels of a frame become road, which has 76,000 of them. From 1.5 to 2.5 the same call is
# right, as both bounds become 2, so a test on class 2 passes: each even class comes alone, each odd
# one with both neighbours. Bounds that are no halves are rounded, too, such as those of a colour that
# are computed from a mean and a deviation: the value 200 lies in the range from 200.4 to 255. Nothing
# is said.
#
# `threshold` and `compare` of the same image with the same fractions are right, and so is `inRange`
# once the image is float32. Whole bounds, both of them 1 here, are right as well.
#
# Source: `inRange` in modules/core/src/arithm.cpp of OpenCV converts the bounds to int32 for an image
# of 8 or 16 bits, and then to the type of the image. The documentation of inRange gives the condition
# `lowerb <= src <= upperb`, and says nothing of rounding.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 5.0.0.93 4.14.0.94; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    opencv-python-headless==$version numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import cv2
import numpy as np

print("OpenCV", cv2.__version__, "numpy", np.__version__)
labels = np.arange(6, dtype=np.uint8).reshape(1, 6)


def classes(mask):
    """Return the classes that a mask of the label image has."""
    return labels[mask > 0].tolist()


for wanted in labels.ravel().tolist():
    bounds = wanted - 0.5, wanted + 0.5
    taken = classes(cv2.inRange(labels, *bounds))
    by_numpy = classes((bounds[0] <= labels) & (labels <= bounds[1]))
    print(f"from {bounds[0]} to {bounds[1]}: {taken} by inRange, {by_numpy} by NumPy")
    assert by_numpy == [wanted]
    assert taken == ([wanted] if wanted % 2 == 0 else [i for i in range(6) if abs(i - wanted) < 2])

for kind in (np.int8, np.uint16, np.int16, np.int32):
    assert classes(cv2.inRange(labels.astype(kind), 0.5, 1.5)) == [0, 1, 2]
assert classes(cv2.inRange(labels.astype(np.float32), 0.5, 1.5)) == [1]
assert classes(cv2.inRange(labels, 1, 1)) == [1]
assert classes(cv2.threshold(labels, 0.5, 1, cv2.THRESH_BINARY)[1]) == [1, 2, 3, 4, 5]
assert classes(cv2.threshold(labels, 1.5, 1, cv2.THRESH_BINARY_INV)[1]) == [0, 1]
assert classes(cv2.compare(labels, 0.5, cv2.CMP_GT)) == [1, 2, 3, 4, 5]
assert classes(cv2.compare(labels, 1.5, cv2.CMP_LT)) == [0, 1]

image = np.full((1, 1, 3), (128, 200, 40), np.uint8)
assert not ((image >= (128.2, 200.4, 30)) & (image <= (255, 255, 255))).all()
assert cv2.inRange(image, (128.2, 200.4, 30), (255, 255, 255)).all()
print("the colour (128, 200, 40) is in the range from (128.2, 200.4, 30) up")

scene = np.zeros((320, 480), np.uint8)
scene[160:] = 1  # road
scene[200:220, 100:140] = 2  # a car
mask = cv2.inRange(scene, 0.5, 1.5)
print(f"{(scene == 1).sum()} pixels are road, {(mask > 0).sum()} of {mask.size} by inRange")
assert mask.all()
PYTHON
done
