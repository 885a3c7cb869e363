#!/usr/bin/env bash
# OpenCV's CLAHE with its usual limits hardly changes a 16-bit picture, and 12 bits leave their range.
#
# Software: opencv-python-headless 4.14.0.94 and 5.0.0.93; with numpy 2.4.6.
#
# CLAHE evens out light and shadow; its clip limit says how far contrast may grow. OpenCV takes pictures
# of 8 and of 16 bits, and the same limit. But it counts the limit for each level, of which there are
# 256 or 65536: clip limit 4 in a tile of 80x60 pixels is 75 pixels a level with 8 bits, and 0.3 with
# 16, which is raised to 1. So limits 1, 2, 4 and 13 give the same 16-bit picture, pixel by pixel. Here a
# limit of 4 raises the contrast of 8 bits 4.2 times, and that of the same picture as 16 bits 1.1 times:
# a limit that was tuned on JPEGs does nothing for raw or thermal pictures. And the levels are spread
# over all 16 bits: a 12-bit picture in uint16, as cameras and ROS (mono16) give it, gets 13 % brighter
# with a limit of 4, and has levels above 4095 with one of 400.
#
# Source: documentation of `CLAHE.apply`: "Source image of type CV_8UC1 or CV_16UC1"; of `createCLAHE`:
# "clipLimit Threshold for contrast limiting". None of them says that it depends on the depth.
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

# A dull picture: smooth texture of levels 100 to 131.
texture = np.random.default_rng(0).integers(0, 256, (480, 640)).astype(np.uint8)
texture = cv2.GaussianBlur(texture, (0, 0), 6)
dull = (100 + cv2.normalize(texture, None, 0, 255, cv2.NORM_MINMAX) // 8).astype(np.uint8)
as_16_bits = dull.astype(np.uint16) * 257
as_12_bits = dull.astype(np.uint16) * 16


def evened(picture, limit):
    return cv2.createCLAHE(limit, (8, 8)).apply(picture)


print(f"OpenCV {cv2.__version__}")
growth = {}
for limit in (1.0, 2.0, 4.0, 13.0):
    for name, picture in {"8 bits": dull, "16 bits": as_16_bits, "12 bits": as_12_bits}.items():
        growth[name, limit] = evened(picture, limit).std() / picture.std()
    told = (f"{name} {growth[name, limit]:.1f}" for name in ("8 bits", "16 bits", "12 bits"))
    print(f"limit {limit:g}: contrast grows by", ", ".join(told))
    assert np.array_equal(evened(as_16_bits, limit), evened(as_16_bits, 1.0))
assert growth["8 bits", 4.0] > 4
assert growth["16 bits", 4.0] < 1.15
assert growth["8 bits", 4.0] > 2 * growth["8 bits", 1.0]

brighter = evened(as_12_bits, 4.0).mean() / as_12_bits.mean()
greatest = evened(as_12_bits, 400.0).max()
print(f"12 bits: {brighter:.2f} times as bright at 4; greatest level at 400: {greatest}")
assert 1.1 < brighter < 1.2
assert greatest > 4095
PYTHON
done
