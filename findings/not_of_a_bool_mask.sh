#!/usr/bin/env bash
# OpenCV 5 takes masks of True and False, and its `bitwise_not` of one is True everywhere.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, with numpy 2.4.6.
#
# OpenCV 4 refuses an array of type bool, so programs convert masks to uint8. OpenCV 5 takes them: it
# resizes, flips and counts them, uses them as `mask=` and combines them by `bitwise_and`,
# `bitwise_or` and `bitwise_xor`, and the results are right and of type bool. `bitwise_not` returns
# an array of type bool, too, but turns the bits of the bytes: 1 becomes 254, 0 becomes 255. Both are
# True. A mask with half of the pixels has an inverse with all of them by `sum`, `mean`,
# `countNonZero` and as `mask=` of `cv2.mean`. By NumPy, half of the frame is road and no road at
# once. A rate over all that is not road is then a rate over the whole frame. Nothing is raised.
# Programs that mix masks by OpenCV alone do not notice: its bitwise functions see that 254 and 1
# have no bit in common.
#
# `~mask`, or `cv2.bitwise_xor` with an array of True, is right.
#
# Source: the bytes of the results; issue 25895 of opencv/opencv on the type CV_Bool of version 5 says
# that its functions treat any value but 0 as true.
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

road = np.zeros((480, 640), bool)
road[240:] = True
image = np.where(road, 100, 20).astype(np.uint8)

if cv2.__version__.startswith("4"):
    try:
        cv2.bitwise_not(road)
    except cv2.error:
        print(f"OpenCV {cv2.__version__} refuses a mask of type bool")
    else:
        raise SystemExit("OpenCV 4 takes a mask of type bool")
    raise SystemExit

# What is right: these accept the mask, and return what NumPy does.
assert cv2.countNonZero(road) == road.sum()
assert cv2.mean(image, mask=road)[0] == 100
small = cv2.resize(road, (320, 240), interpolation=cv2.INTER_NEAREST)
assert small.dtype == bool and np.array_equal(small, road[::2, ::2])
assert np.array_equal(cv2.flip(road, 0), road[::-1])
assert np.array_equal(cv2.bitwise_and(road, ~road), road & ~road)
assert np.array_equal(cv2.bitwise_or(road, ~road), road | ~road)
assert np.array_equal(cv2.bitwise_xor(road, np.ones_like(road)), ~road)

other = cv2.bitwise_not(road)
print(f"OpenCV {cv2.__version__}: road {road.mean():.0%}, bitwise_not of it {other.mean():.0%}")
print(f"as bytes {np.unique(other.view(np.uint8))}, of type {other.dtype}, values {np.unique(other)}")
print(f"both at once, by NumPy: {(road & other).mean():.0%}")
of_rest, of_other = (round(cv2.mean(image, mask=mask)[0], 6) for mask in (~road, other))
print(f"mean of the image off the road: {of_rest} with ~road, {of_other} with bitwise_not")
assert other.dtype == bool
assert other.all() and other.sum() == road.size == cv2.countNonZero(other)
assert np.array_equal(np.unique(other.view(np.uint8)), [254, 255])
assert np.array_equal(road & other, road)
assert cv2.countNonZero(cv2.bitwise_and(road, other)) == 0
assert (of_rest, of_other) == (20, 60) and image.mean() == 60
PYTHON
done
