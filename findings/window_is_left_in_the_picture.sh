#!/usr/bin/env bash
# OpenCV's `phaseCorrelate` writes its window into the caller's pictures, for 640x480, but not for 641x481.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, with numpy 2.4.6.
#
# `phaseCorrelate` says how far one picture lies from another, and takes a window, such as a Hanning
# window, that fades both out towards their edges. Where the size suits the transform, as 640x480, 1280x720
# and 1920x1080 do, the pictures are multiplied by the window in place: afterwards the caller's two arrays
# are dark at their edges and black at the border. Other sizes, as 641x481 and KITTI's 1242x375, are padded
# first, which makes a copy, and are left alone. In the example the lower half of a frame is road, bright
# enough for a threshold; once the camera's shift was measured, the same threshold finds 22 % of it.
# In a log each frame is compared with the one before and the one behind, and so is faded twice. Without
# a window nothing is changed. Nothing is changed either if the pictures are passed as copies.
#
# Source: `phaseCorrelate` in modules/imgproc/src/phasecorr.cpp of OpenCV calls its source "padded" without
# a copy if there is nothing to pad, and multiplies that. The documentation has both pictures as inputs,
# "Source floating point array", and the signature in Python as `src1, src2[, window]`.
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

CHANGED = {(640, 480): True, (1280, 720): True, (1920, 1080): True}
KEPT = {(641, 481): False, (1242, 375): False, (1241, 376): False}
print(f"OpenCV {cv2.__version__}")
for (width, height), expected in {**CHANGED, **KEPT}.items():
    random = np.random.default_rng(0)
    first = random.uniform(60, 90, (height, width)).astype(np.float32)
    first[height // 2 :] += 100  # the road, 160 to 190
    road = first > 120
    second = np.roll(first, 3, axis=1)
    before = first.copy(), second.copy()
    window = cv2.createHanningWindow((width, height), cv2.CV_32F)

    cv2.phaseCorrelate(first, second)
    assert np.array_equal(first, before[0])  # without a window all is well

    cv2.phaseCorrelate(first, second, window)
    found = first > 120
    iou = (found & road).sum() / (found | road).sum()
    changed = not np.array_equal(first, before[0])
    means = f"mean {before[0].mean():.0f} to {first.mean():.0f}"
    print(f"{width}x{height}: changed {changed}, {means},", end=" ")
    print(f"IoU of the road with itself {iou:.2f}")
    assert changed == expected == (not np.array_equal(second, before[1]))
    if changed:
        assert np.array_equal(first, before[0] * window)
        assert not first[0].any()
        assert iou < 0.5

        cv2.phaseCorrelate(first, second, window)
        assert np.allclose(first, before[0] * window * window, rtol=1e-5)
    else:
        assert iou == 1
PYTHON
done
