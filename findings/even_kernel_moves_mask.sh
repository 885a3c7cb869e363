#!/usr/bin/env bash
# OpenCV's opening or closing with a kernel of even size moves the whole mask by a pixel.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, against scipy 1.17.1 and scikit-image 0.26.0,
# with numpy 2.4.6.
#
# An opening lies within the mask and a closing contains it, in every textbook; a square that is
# larger than the kernel stays as it is. `cv2.morphologyEx` with a kernel of 2x2 or 4x4 pixels
# returns the square one row lower and one column further right. Each opening, closing and
# repetition moves it again: three closings by three pixels. `scipy.ndimage` and scikit-image leave
# the square where it is, with the same kernels. A road mask that is cleaned so loses its left
# edge and gains a right one: a perfect mask of 20x20 pixels has an IoU of 0.82, and its top-hat, which should
# be empty, finds thin objects along the edges. Nothing in the picture looks wrong.
#
# The reason: an erosion has to use the kernel of the dilation turned by 180 degrees. OpenCV turns
# nothing, which is the same only if the anchor is the middle, and an even kernel has none.
# Dilation alone, or erosion alone, is off by half a pixel, as it must be.
#
# Take kernels of odd size; or dilate with the anchor (k // 2, k // 2) and erode with the anchor
# (k // 2 - 1, k // 2 - 1).
#
# Source: the documentation of `cv::erode` and `cv::dilate` has one formula for both, src(x + x',
# y + y') over the kernel around the anchor, and that of `morphologyEx` makes both operations of
# these with one anchor; it does not speak of even kernels.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 4.14.0.94 5.0.0.93; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    opencv-python-headless==$version scipy==1.17.1 scikit-image==0.26.0 numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import cv2
import numpy as np
from scipy import ndimage
from skimage import morphology

lane = np.zeros((100, 100), np.uint8)
lane[40:60, 40:60] = 1
moved = np.roll(lane, (1, 1), axis=(0, 1))


def place(mask):
    rows, columns = np.nonzero(mask)
    return f"rows {rows.min()}-{rows.max()}, columns {columns.min()}-{columns.max()}"


for size in (3, 2, 4):
    kernel = np.ones((size, size), np.uint8)
    opened = cv2.morphologyEx(lane, cv2.MORPH_OPEN, kernel)
    closed = cv2.morphologyEx(lane, cv2.MORPH_CLOSE, kernel)
    hat = cv2.morphologyEx(lane, cv2.MORPH_TOPHAT, kernel)
    others = [
        ndimage.binary_opening(lane, kernel),
        ndimage.binary_closing(lane, kernel),
        morphology.opening(lane, kernel),
        morphology.closing(lane, kernel),
    ]
    print(
        f"OpenCV {cv2.__version__}, kernel {size}x{size}: closed {place(closed)}, "
        f"top-hat {hat.sum()} pixels; SciPy and scikit-image {place(others[0])}"
    )
    assert all(np.array_equal(mask, lane) for mask in others)
    expected = lane if size % 2 else moved
    assert np.array_equal(opened, expected) and np.array_equal(closed, expected)
    assert bool(hat.any()) == (size % 2 == 0)

pair = np.ones((2, 2), np.uint8)
thrice = lane
for _ in range(3):
    thrice = cv2.morphologyEx(thrice, cv2.MORPH_CLOSE, pair)
once = cv2.morphologyEx(lane, cv2.MORPH_CLOSE, pair)
rates = [(mask & lane).sum() / (mask | lane).sum() for mask in (once, thrice)]
print(f"IoU with itself after one closing {rates[0]:.3f}, after three {rates[1]:.3f}")
assert np.array_equal(thrice, np.roll(lane, (3, 3), axis=(0, 1)))
right = cv2.erode(cv2.dilate(lane, pair, anchor=(1, 1)), pair, anchor=(0, 0))
assert np.array_equal(right, lane)
PYTHON
done
