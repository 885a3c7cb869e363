#!/usr/bin/env bash
# One square outline has 100, 110 or 121 pixels, by which library fills it.
#
# Software: pycocotools 2.0.11, opencv-python-headless 5.0.0.93, Pillow 13.0.0, scikit-image 0.26.0,
# Matplotlib 3.11.2.
#
# An annotation tool draws a square with corners at 10 and 20 in both directions, which is 10 pixels
# wide and has an area of 100. pycocotools, which takes integers for borders between pixels, fills
# 100. OpenCV, Pillow and scikit-image take integers for centres of pixels and fill both ends: 121.
# Matplotlib's `contains_points` takes in the pixels on some sides and not on others: 110. With every
# corner moved by half a pixel, as the border of a pixel lies from its centre, scikit-image fills 100,
# too. A road mask of 640x480 that is filled by another library than its labels were differs from
# them along the whole edge.
#
# Source: pycocotools' `frPyObjects`, cv2.fillPoly, PIL.ImageDraw.polygon, skimage.draw.polygon and
# matplotlib.path.Path.contains_points, each as it is called by its own documentation.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check pycocotools==2.0.11 \
  opencv-python-headless==5.0.0.93 pillow==13.0.0 scikit-image==0.26.0 matplotlib==3.11.2 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
from importlib.metadata import version

import cv2
import numpy as np
from matplotlib.path import Path
from PIL import Image, ImageDraw
from pycocotools import mask
from skimage.draw import polygon

SIZE = 40
SQUARE = [(10, 10), (20, 10), (20, 20), (10, 20)]


def by_opencv(corners):
    filled = np.zeros((SIZE, SIZE), np.uint8)
    cv2.fillPoly(filled, [np.array(corners)], 1)
    return int(filled.sum())


def by_pillow(corners):
    image = Image.new("L", (SIZE, SIZE))
    ImageDraw.Draw(image).polygon(corners, fill=1)
    return int(np.asarray(image).sum())


def by_scikit_image(corners):
    columns, rows = zip(*corners)
    return len(polygon(rows, columns, (SIZE, SIZE))[0])


def by_pycocotools(corners):
    (code,) = mask.frPyObjects([[number for corner in corners for number in corner]], SIZE, SIZE)
    return int(mask.area(code))


def by_matplotlib(corners):
    rows, columns = np.mgrid[:SIZE, :SIZE]
    return int(Path(corners).contains_points(np.c_[columns.ravel(), rows.ravel()]).sum())


EXPECTED = {
    "pycocotools": (by_pycocotools, 100),
    "opencv-python-headless": (by_opencv, 121),
    "pillow": (by_pillow, 121),
    "scikit-image": (by_scikit_image, 121),
    "matplotlib": (by_matplotlib, 110),
}
for name, (fill, pixels) in EXPECTED.items():
    print(f"{name} {version(name)}: {fill(SQUARE)} pixels")
    assert fill(SQUARE) == pixels
moved = by_scikit_image([(x - 0.5, y - 0.5) for x, y in SQUARE])
print(f"scikit-image, corners moved by half a pixel: {moved} pixels")
assert moved == 100
PYTHON
