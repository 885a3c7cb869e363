#!/usr/bin/env bash
# OpenCV's correlation of a colour histogram of three dimensions with itself is -1; flattened, it is 1.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, with numpy 2.4.6.
#
# To find frames of the same place or light, colour histograms of 8x8x8 bins are compared by
# HISTCMP_CORREL, which is 1 for "alike", 0 for "not related" and -1 for "opposite". NumPy's array of
# three dimensions is taken for an image of 8 rows, 8 columns and 8 channels, and its bins are counted as
# 64, not 512, so both means are 8 times too large. A frame of many colours has -1.0 with itself, the next
# frame -1.004, another place -3.05, and a dark frame of few colours NaN, which no correlation
# can be. So a search that asks for more than 0.9 finds nothing, not even the frame itself; and for histograms
# of few colours the answer is near 1, so that a test with a plain picture passes. Histograms of
# one and of two dimensions are right, and so are all three-dimensional ones after `ravel()`. The
# other methods of `compareHist` need no mean and are right.
#
# Source: `compareHist` in modules/imgproc/src/histogram.cpp of OpenCV divides by the number of rows times
# columns. Its documentation says "N is a total number of histogram bins" and "the function works well
# with 1-, 2-, 3-dimensional dense histograms". Reported as opencv/opencv issues 13990 and 29706.
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

random = np.random.default_rng(0)


def frame(brightness, spread):
    colours = random.normal(brightness, spread, (480, 640, 3)) + [-10, 0, 10]
    return np.clip(colours, 0, 255).astype(np.uint8)


def histogram(picture):
    return cv2.calcHist([picture], [0, 1, 2], None, [8, 8, 8], [0, 256] * 3)


def alike(one, other):
    return cv2.compareHist(one, other, cv2.HISTCMP_CORREL)


print(f"OpenCV {cv2.__version__}")
asked = histogram(frame(100, 40))
found = {
    "itself": asked,
    "next frame": histogram(frame(102, 40)),
    "another place": histogram(frame(170, 40)),
    "few colours": histogram(frame(60, 8)),
}
cube, flat = {}, {}
for name, other in found.items():
    cube[name] = alike(asked, other)
    flat[name] = alike(asked.ravel(), other.ravel())
    by_numpy = np.corrcoef(asked.ravel(), other.ravel())[0, 1]
    print(f"{name}: {cube[name]:.3f}, flattened {flat[name]:.3f}, by NumPy {by_numpy:.3f}")
    assert abs(flat[name] - by_numpy) < 1e-6
assert abs(cube["itself"] + 1) < 1e-9
assert abs(flat["itself"] - 1) < 1e-9
assert cube["next frame"] < -1 and flat["next frame"] > 0.99
assert cube["another place"] < -2
assert np.isnan(cube["few colours"])

# The formula of the documentation, with the bins counted as rows times columns.
one, other = asked.astype(float), found["another place"].astype(float)
mean_one, mean_other = one.sum() / 64, other.sum() / 64
above = (one * other).sum() - 64 * mean_one * mean_other
below = ((one**2).sum() - 64 * mean_one**2) * ((other**2).sum() - 64 * mean_other**2)
assert abs(above / below**0.5 - cube["another place"]) < 1e-6

few = histogram(frame(60, 3))
print(f"a plain picture with itself: {alike(few, few):.3f}")
assert abs(alike(few, few) - 1) < 1e-9

planes = [cv2.calcHist([frame(b, 40)], [0, 1], None, [8, 8], [0, 256] * 2) for b in (100, 102)]
by_numpy = np.corrcoef(planes[0].ravel(), planes[1].ravel())[0, 1]
assert abs(alike(*planes) - by_numpy) < 1e-6
for method in (cv2.HISTCMP_CHISQR, cv2.HISTCMP_INTERSECT, cv2.HISTCMP_BHATTACHARYYA):
    values = [
        cv2.compareHist(shape(asked), shape(found["next frame"]), method)
        for shape in (np.ascontiguousarray, np.ravel)
    ]
    assert np.isclose(*values)
PYTHON
done
