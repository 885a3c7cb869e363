#!/usr/bin/env bash
# OpenCV 5 multiplies two bright pixels of 16 bits to 0: products saturate at 65535 up to 2^31 alone.
#
# Software: opencv-python-headless 5.0.0.93, against 4.14.0.94; with numpy 2.4.6.
#
# OpenCV's arithmetic saturates: a product that does not fit uint16 is 65535. So do `cv2.multiply` of
# two arrays of uint16, and `cv2.pow` with the power 2, in version 4. In version 5 a product of 2^31 or
# more is 0: 46340 squared is 65535, 46341 squared is 0. Where a picture is brightest its square is
# black. A mask of "bright squared" loses the sky and the lamps, a variance by squares (mean of squares
# less square of mean) becomes negative there, and a picture of 16 bits that is multiplied by a mask of
# 65535 is 0 where it was at least 32769. Darker pictures, of 12 or 14 bits, never reach it, nor does
# a test with small numbers. uint8 and int16 are right, and so is `multiply` with a `dtype` of floats.
#
# Source: the documentation of `multiply` says saturate(scale * src1 * src2) for both versions; its
# note on saturation leaves out CV_32S alone. Issue 29893 of opencv/opencv, open, says the same of
# short rows; by its reports long rows are right on some processors. Rows are short here.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 4.14.0.94 5.0.0.93; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    opencv-python-headless==$version numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import cv2
import numpy as np

is_new = cv2.__version__.startswith("5")
levels = np.array([[100, 300, 46340, 46341, 60000, 65535]], np.uint16)
saturated = np.minimum(levels.astype(np.uint64) ** 2, 65535)
mask = np.full_like(levels, 65535)
for words, result, exact in (
    ("squared by multiply", cv2.multiply(levels, levels), saturated),
    ("squared by pow", cv2.pow(levels, 2), saturated),
    ("multiplied by 65535", cv2.multiply(levels, mask), mask),
):
    print(f"OpenCV {cv2.__version__}, {levels[0].tolist()} {words}: {result[0].tolist()}")
    products = levels.astype(np.uint64) * (mask if words.endswith("65535") else levels)
    lost = (products >= 2**31) & is_new
    assert result.dtype == np.uint16
    assert np.array_equal(result, np.where(lost, 0, exact))
    assert lost.any() == is_new

# What is right: other types, a scale, and a result of floats.
small = np.array([[10, 16, 255]], np.uint8)
assert cv2.multiply(small, small).tolist() == [[100, 255, 255]]
signed = np.array([[100, 200, -32768]], np.int16)
assert cv2.multiply(signed, signed).tolist() == [[10000, 32767, 32767]]
scaled = cv2.multiply(levels, levels, scale=1 / 65535)
assert np.abs(scaled - np.rint(levels.astype(float) ** 2 / 65535)).max() <= 1
floats = cv2.multiply(levels, levels, dtype=cv2.CV_64F)
assert np.array_equal(floats, levels.astype(float) ** 2)
PYTHON
done
