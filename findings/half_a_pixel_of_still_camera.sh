#!/usr/bin/env bash
# OpenCV's `phaseCorrelate` of a picture with itself is half a pixel, for pictures of 224x224 or 1242x375.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, with numpy 2.4.6.
#
# `phaseCorrelate` says how far one picture lies from another, so that a camera's shake can be taken out
# of a log. It pads both pictures to a size that suits the transform. Where the padded size is odd, half
# a pixel is added to the answer: (0.5, 0.5) for a picture of 224x224 against itself, as 224 is padded to
# 225, and (0, 0.5) for KITTI's 1242x375. A picture that moved by (5, 2) lies at (5.5, 2.5), and the
# way back is (-4.5, -1.5). The error has one sign, so over 100 frames of a camera that stands still the
# shifts from each to the next add up to 50 pixels. The response is 1.0, "sure". For 640x480 and 1280x720
# all is right, so a test on a usual size passes. One eighth of all sizes up to 2000 are padded to an
# odd one.
#
# Half the difference of the shifts there and back is right.
#
# Source: `phaseCorrelate` in modules/imgproc/src/phasecorr.cpp of OpenCV moves the origin to a whole pixel
# and then subtracts half the size as a fraction. The documentation says that the function "is used to
# detect translational shifts that occur between two images", and nothing of sizes.
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

SIZES = ((640, 480), (1280, 720), (1242, 375), (1241, 376), (1226, 370), (224, 224))
print(f"OpenCV {cv2.__version__}")
for width, height in SIZES:
    noise = np.random.default_rng(0).random((height, width)).astype(np.float32)
    picture = cv2.GaussianBlur(noise, (0, 0), 2)
    moved = np.roll(picture, (2, 5), (0, 1))
    # Copies, as `phaseCorrelate` may write its window into the pictures that it is given.
    window = cv2.createHanningWindow((width, height), cv2.CV_32F)
    padded = np.array([cv2.getOptimalDFTSize(width), cv2.getOptimalDFTSize(height)])

    still, response = cv2.phaseCorrelate(picture, picture)
    there = np.array(cv2.phaseCorrelate(picture.copy(), moved.copy(), window)[0])
    back = np.array(cv2.phaseCorrelate(moved.copy(), picture.copy(), window)[0])
    print(f"{width}x{height} padded to {padded[0]}x{padded[1]}:", end=" ")
    print("itself", np.round(still, 1) + 0.0, "there", there.round(1), "back", back.round(1))
    assert response > 0.99
    assert np.allclose(still, padded % 2 / 2, atol=0.01)
    assert np.allclose(there, [5, 2] + padded % 2 / 2, atol=0.2)
    assert np.allclose(back, [-5, -2] + padded % 2 / 2, atol=0.2)
    assert np.allclose((there - back) / 2, [5, 2], atol=0.2)

odd = np.mean([cv2.getOptimalDFTSize(size) % 2 for size in range(1, 2001)])
print(f"sizes that are padded to an odd one: {odd:.0%}")
assert 0.1 < odd < 0.15
PYTHON
done
