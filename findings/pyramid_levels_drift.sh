#!/usr/bin/env bash
# A mask from a level of OpenCV's pyramid lies beside its picture once `resize` enlarges it again.
#
# Software: opencv-python-headless 5.0.0.93, scikit-image 0.26.0; with numpy 2.4.6.
#
# `cv2.pyrDown` keeps each second pixel: pixel n of a level is pixel 2n of the level below. `cv2.resize`
# takes pixels as squares: pixel n of a half-sized picture covers 2n and 2n+1, its centre is at 2n + 0.5.
# Each is right alone. Together, as in "find the road on a small level for speed, then enlarge the
# mask", all moves right and down by (2^k - 1) / 2 pixels at level k: 3.5 pixels at the third. Here it
# makes 5.2 % of a disc of 240 pixels wrong, in place of 0.3 %. `pyrUp` leads back to the same place, and
# so do `resize` both ways, and scikit-image's `pyramid_reduce` and `pyramid_expand`, whose levels have
# other places. A level by `pyrDown` of the mirrored picture is not the mirrored level, so that a
# method that is checked on flipped pictures seems to depend on the side.
#
# Source: the documentation of `pyrDown` says that it rejects even rows and columns; that of `resize`
# does not say where the centres of pixels lie, and neither that they differ.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  opencv-python-headless==5.0.0.93 scikit-image==0.26.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import cv2
import numpy as np
from skimage.transform import pyramid_expand, pyramid_reduce

WIDTH, HEIGHT = 640, 480
rows, columns = np.mgrid[:HEIGHT, :WIDTH]
disc = np.hypot(rows - 239.5, columns - 319.5) < 120
picture = np.where(disc, 200, 50).astype(np.uint8)


def enlarged(small):
    return cv2.resize(small, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR)


def expanded(small, level):
    for _ in range(level):
        small = cv2.pyrUp(small)
    return small


def smaller(picture, level, step):
    for _ in range(level):
        picture = step(picture)
    return picture


def halved(picture):
    return cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)


def reduced(picture):
    return pyramid_reduce(picture, preserve_range=True)


for level in (1, 2, 3):
    small = smaller(picture, level, cv2.pyrDown)
    by_skimage = smaller(picture.astype(float), level, reduced)
    for _ in range(level):
        by_skimage = pyramid_expand(by_skimage, preserve_range=True)
    ways = {
        "pyrDown, resize": enlarged(small),
        "pyrDown, pyrUp": expanded(small, level),
        "resize, resize": enlarged(smaller(picture, level, halved)),
        "scikit-image": by_skimage,
    }
    for words, result in ways.items():
        mask = result > 125
        moved = [places[mask].mean() - places[disc].mean() for places in (columns, rows)]
        wrong = np.count_nonzero(mask != disc) / np.count_nonzero(disc)
        right, down = (float(f"{pixels:.2f}") + 0.0 for pixels in moved)
        print(f"level {level}, {words}: {right:+} right, {down:+} down, {wrong:.1%} wrong")
        expected = (2**level - 1) / 2 if words == "pyrDown, resize" else 0.0
        assert np.allclose(moved, expected, atol=0.1)
        assert (wrong > 0.006) == (expected > 0)

mirrored = cv2.pyrDown(np.ascontiguousarray(picture[:, ::-1]))[:, ::-1]
assert not np.array_equal(mirrored, cv2.pyrDown(picture))
PYTHON
