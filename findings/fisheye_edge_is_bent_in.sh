#!/usr/bin/env bash
# OpenCV's fisheye functions do not undo each other: pixels far out come back at too small an angle.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, with numpy 2.4.6.
#
# `cv2.fisheye.projectPoints` takes a ray to a pixel, and `cv2.fisheye.undistortPoints` with the same
# matrix and distortion takes the pixel back to the ray. With k1 = 0.05 both agree up to 81 degrees
# from the optical axis. A ray at 85 degrees comes back at 82.07, and one at 88 degrees at 82.39. On
# a wall one metre ahead the first lies 11.4 m beside the middle, and comes back at 7.2 m. Nothing is
# raised, and no value marks the point.
#
# The limit is no angle: pixels more than pi / 2 focal lengths from the centre are taken for pixels
# on that circle. A lens with k1 = -0.02 has none within 88 degrees. The greater k1 is, the smaller
# is the angle at which it begins.
#
# Source: modules/calib3d/src/fisheye.cpp limits the distorted angle `theta_d` to pi / 2 before it
# solves for the angle, and says that the model is valid up to a field of view of 180 degrees.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 5.0.0.93 4.14.0.94; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    opencv-python-headless==$version numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import math

import cv2
import numpy as np

FOCAL, CENTRE = 200.0, 640.0
MATRIX = np.array([[FOCAL, 0, CENTRE], [0, FOCAL, CENTRE], [0, 0, 1]])


def there_and_back(degrees, k1):
    """Return how far a ray's pixel lies from the centre in focal lengths, and the ray it gives."""
    angle, distortion = math.radians(degrees), np.array([k1, 0, 0, 0])
    ray = np.array([[[math.sin(angle), 0, math.cos(angle)]]])
    pixel = cv2.fisheye.projectPoints(ray, np.zeros(3), np.zeros(3), MATRIX, distortion)[0]
    (right, down) = cv2.fisheye.undistortPoints(pixel, MATRIX, distortion)[0, 0]
    assert down == 0
    return float(pixel[0, 0, 0] - CENTRE) / FOCAL, math.degrees(math.atan(right))


print(f"OpenCV {cv2.__version__}")
for degrees, k1, expected in (
    (80, 0.05, 80),
    (81, 0.05, 81),
    (85, 0.05, 82.07),
    (88, 0.05, 82.39),
    (85, -0.02, 85),
    (88, -0.02, 88),
):
    radius, found = there_and_back(degrees, k1)
    print(f"k1 {k1}: {degrees} degrees, {radius:.3f} focal lengths, comes back as {found:.2f}")
    assert abs(found - expected) < 0.005
    assert (radius > math.pi / 2) == (expected != degrees)
assert round(math.tan(math.radians(85)), 1) == 11.4
assert round(math.tan(math.radians(there_and_back(85, 0.05)[1])), 1) == 7.2
PYTHON
done
