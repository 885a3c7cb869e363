#!/usr/bin/env bash
# OpenCV's `bilateralFilter` rounds down, so that it darkens a grey picture, but only with Intel's IPP.
#
# Software: opencv-python-headless 4.5.5.64 and 5.0.0.93 for x86-64; with numpy 1.26.4 and 2.4.6.
#
# The wheels for x86-64 hold Intel's IPP and use it without a word. Its filter of 3x3 or 5x5 pixels for
# one channel of 8 bits rounds down: half of all pixels are one level too dark, and the picture loses
# half a grey level. Five passes lose two and a half levels. Larger filters, pictures of colour
# (also the same grey three times), and OpenCV without IPP, as it is on ARM, round to the nearest level.
# So a threshold, a hash or a golden picture of a denoised camera differs between the computer on
# the vehicle and that of the desk, and between a grey log and the same log as RGB. A flat picture
# shows nothing, as it has no fractions to lose: that is why a test on one passes.
#
# Source: the documentation of `bilateralFilter` names no rounding; OpenCV's own test of it allows one
# level of difference at each pixel (pull request 8629), and so does not see a bias.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for versions in "4.5.5.64 1.26.4" "5.0.0.93 2.4.6"; do
  read -r version numpy <<<"$versions"
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    opencv-python-headless==$version numpy==$numpy
  "$folder/$version/bin/python" - <<'PYTHON'
import sys

import cv2
import numpy as np

if not cv2.ipp.useIPP():
    sys.exit("this needs a machine with x86-64: OpenCV has no IPP here")
DEVIATION = 20.0
rng = np.random.default_rng(0)
grey = rng.integers(0, 256, (480, 640)).astype(np.uint8)


def exact_filter(picture, size):
    """Return the weighted means without rounding, ``(H, W)``, as the documentation defines them."""
    reach = size // 2
    height, width = picture.shape
    padded = np.pad(picture.astype(float), reach, mode="reflect")
    total, weights = np.zeros((2, height, width))
    for down in range(-reach, reach + 1):
        for right in range(-reach, reach + 1):
            if down**2 + right**2 <= reach**2:
                top, left = reach + down, reach + right
                near = padded[top : top + height, left : left + width]
                distance = down**2 + right**2 + (near - picture) ** 2
                weight = np.exp(-distance / (2 * DEVIATION**2))
                total, weights = total + weight * near, weights + weight
    return total / weights


def filtered(picture, size, uses_ipp):
    cv2.ipp.setUseIPP(uses_ipp)
    return cv2.bilateralFilter(picture, size, DEVIATION, DEVIATION)


print(f"OpenCV {cv2.__version__}, {cv2.ipp.getIppVersion()}")
for size in (3, 5, 7):
    exact = exact_filter(grey, size)
    for uses_ipp in (True, False):
        result = filtered(grey, size, uses_ipp)
        bias, wrong = (result - exact).mean(), np.mean(result != np.rint(exact))
        where = "with IPP" if uses_ipp else "without "
        print(f"{size}x{size} {where}: {bias:+.2f} levels; {wrong:.2%} of the pixels wrong")
        if uses_ipp and size < 7:
            assert -0.52 < bias < -0.45
            assert 0.45 < wrong < 0.52
            assert np.mean(result == np.floor(exact)) > 0.98
        else:
            assert abs(bias) < 0.01
            assert wrong < 0.001

passes = {True: grey, False: grey}
for _ in range(5):
    passes = {ipp: filtered(picture, 5, ipp) for ipp, picture in passes.items()}
means = {ipp: picture.mean() - grey.mean() for ipp, picture in passes.items()}
print(f"five passes: {means[True]:+.2f} levels with IPP, {means[False]:+.2f} without")
assert means[True] < -2
assert abs(means[False]) < 0.05

coloured = cv2.merge([grey, grey, grey])
results = [filtered(coloured, 5, uses_ipp) for uses_ipp in (True, False)]
assert np.mean(results[0] != results[1]) < 0.001
assert (filtered(np.full((9, 9), 200, np.uint8), 5, True) == 200).all()
PYTHON
done
