#!/usr/bin/env bash
# OpenCV draws a line of thickness 3 five pixels wide, and no thickness gives 2, 4 or 6 pixels.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, against Pillow 13.0.0; with numpy 2.4.6.
#
# Lane labels are stored as points, and masks are drawn from them with `cv2.line` or `cv2.polylines` of
# a given thickness. For 1 to 8 a horizontal line is 1, 3, 5, 5, 7, 7, 9 and 9 pixels wide: an even
# number is widened by one pixel, an odd one from 3 on by two, and 3 and 4 are the same picture. Pillow's
# `ImageDraw.line` is as wide as it is told, for all of them. Of the pixels that OpenCV draws for
# thickness 3, two in five lie farther than 1.5 pixels from the line. A lane that was drawn by one
# library for the labels and by the other for the answer has an IoU of 0.60 at thickness 3, 0.71 at 5
# and 0.97 at 30, though both have the same points. `rectangle` and `drawContours` do the same.
#
# The width also depends on the direction: a line of thickness 3 at 45 degrees covers 3.5 pixels across
# and a horizontal one 5.
#
# Source: `ThickLine` in modules/imgproc/src/drawing.cpp of OpenCV adds half a pixel on both sides if the
# thickness is odd, and fills a polygon with its outline, which adds as much again. The documentation of
# `line` says only "thickness Line thickness." Reported as opencv/opencv issue 15604 in 2019.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 5.0.0.93 4.14.0.94; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    opencv-python-headless==$version pillow==13.0.0 numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import cv2
import numpy as np
from PIL import Image, ImageDraw

START, END = (60, 200), (340, 200)
ACROSS = np.abs(np.arange(400) - 200)  # distance of each row from the line


def by_opencv(thickness, start=START, end=END):
    return cv2.line(np.zeros((400, 400), np.uint8), start, end, 1, thickness) > 0


def by_pillow(thickness):
    picture = Image.new("L", (400, 400))
    ImageDraw.Draw(picture).line([START, END], fill=1, width=thickness)
    return np.asarray(picture) > 0


print(f"OpenCV {cv2.__version__}")
widths = {t: int(by_opencv(t)[:, 200].sum()) for t in range(1, 31)}
print("thickness: width", {t: widths[t] for t in range(1, 9)}, "and 30:", widths[30])
assert [widths[t] for t in range(1, 9)] == [1, 3, 5, 5, 7, 7, 9, 9]
assert all(widths[t] == t + 1 + t % 2 for t in range(2, 31))
assert all(by_pillow(t)[:, 200].sum() == t for t in range(1, 31))
assert np.array_equal(by_opencv(3), by_opencv(4))

column = by_opencv(3)[:, 200]
far = (column & (ACROSS > 1.5)).sum() / column.sum()
print(f"thickness 3: {far:.0%} of the pixels lie farther than 1.5 pixels from the line")
assert far == 0.4

for thickness, expected in {3: 0.60, 5: 0.71, 30: 0.97}.items():
    drawn, told = by_opencv(thickness)[:, 100:300], by_pillow(thickness)[:, 100:300]
    iou = (drawn & told).sum() / (drawn | told).sum()
    print(f"thickness {thickness}: IoU of both libraries' lanes {iou:.2f}")
    assert abs(iou - expected) < 0.01

points = np.int32([[50, 50], [350, 50], [350, 350], [50, 350]])
empty = np.zeros((400, 400), np.uint8)
for name, picture in {
    "rectangle": cv2.rectangle(empty.copy(), (50, 50), (350, 350), 1, 3),
    "polylines": cv2.polylines(empty.copy(), [points], True, 1, 3),
    "drawContours": cv2.drawContours(empty.copy(), [points[:, None]], 0, 1, 3),
}.items():
    assert picture[:200, 200].sum() == 5, name

# Across a line at 45 degrees, a row of n pixels is n / sqrt(2) wide.
slanted = by_opencv(3, (60, 60), (340, 340))[200].sum() / 2**0.5
print(f"thickness 3 at 45 degrees: {slanted:.1f} pixels wide")
assert 3.4 < slanted < 3.7
PYTHON
done
