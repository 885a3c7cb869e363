#!/usr/bin/env bash
# OpenCV's `stackBlur` changes the level of a flat 16-bit picture: the white of 12 bits becomes 7.
#
# Software: opencv-python-headless 4.14.0.94 and 5.0.0.93; with numpy 2.4.6.
#
# A blur leaves a flat picture as it is. `cv2.stackBlur`, the fast blur for large kernels, does so for
# pictures of 8 bits and of floats. It divides whole numbers by a factor and a shift from tables, which
# were made for sums of 8-bit pixels. With 16 bits the factor is not exact: 4095, the white of a 12-bit
# camera, becomes 4110 with 5x5 pixels, above what the sensor can give. And the product with the factor
# leaves 32 bits: 40000 becomes 35315 with 5x5, 65535 becomes 34 with 51x51, and with 101x101 pixels
# even 4095 becomes 7. Sizes 3 and 15 are right for each level, so a test with one size tells nothing
# about the next. A background that is blurred to find shadows or to even out
# the light of a thermal, depth or raw camera is then wrong where it is bright.
# Pictures of 8 bits lose up to a level, as both directions round down: 0.94 on average with 7x7.
#
# Source: the documentation of `stackBlur` lists CV_16U and CV_16S among the depths that it takes.
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

FLAT = {
    ("uint16", 4095): {3: 4095, 5: 4110, 15: 4095, 51: 4097, 101: 7},
    ("uint16", 20000): {3: 20000, 5: 20078, 15: 20000, 51: 3626, 101: 3658},
    ("uint16", 40000): {3: 40000, 5: 35315, 15: 40000, 51: 7253, 101: 3220},
    ("uint16", 65535): {3: 65535, 5: 43860, 15: 65535, 51: 34, 101: 138},
    ("int16", -5000): {3: -5000, 5: -5020, 15: -5000, 51: -5003, 101: -915},
    ("uint8", 200): dict.fromkeys((3, 5, 15, 51, 101), 200),
}


def blurred(picture, size):
    return cv2.stackBlur(picture, (size, size))


print(f"OpenCV {cv2.__version__}")
for (kind, level), expected in FLAT.items():
    flat = np.full((300, 300), level, kind)
    levels = {size: int(blurred(flat, size)[150, 150]) for size in expected}
    print(f"{kind} {level} by size: {levels}")
    assert levels == expected
    exact = blurred(flat.astype(np.float32), 51)
    assert np.allclose(exact, level, rtol=1e-4), "floats are right"
    assert np.allclose(cv2.GaussianBlur(flat, (51, 51), 0), level, atol=1), "so is GaussianBlur"

noise = np.random.default_rng(0).integers(0, 256, (480, 640)).astype(np.uint8)
floats = noise.astype(np.float32)
bias = {size: (blurred(noise, size) - blurred(floats, size)).mean() for size in (3, 7)}
print("8 bits against floats:", {size: f"{levels:+.2f} levels" for size, levels in bias.items()})
assert -0.80 < bias[3] < -0.70
assert -0.98 < bias[7] < -0.90
PYTHON
done
