#!/usr/bin/env bash
# OpenCV 5 takes pictures of uint32, and `filter2D` with a large kernel makes them 0 without an error.
#
# Software: opencv-python-headless 5.0.0.93, against 4.14.0.94; with numpy 2.4.6.
#
# Version 4 has no uint32 and refuses such an array. Version 5 has: sums over frames, label numbers and
# counts can be passed as they are. `filter2D` then refuses kernels up to 7x7, as before, with a
# message; but from 9x9 on, where it filters by a Fourier transform, each pixel of the result is 0. The
# same numbers as int32, uint16 or float32 are smoothed rightly. So a heat map of counts that is smoothed
# with a small kernel ends with an error, and with a larger one it says that nothing happened anywhere.
#
# Source: the documentation of `filter2D` says that a Fourier transform is used for kernels of about
# 11x11 and more; its table of depths has no line for uint32.
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
counts = np.random.default_rng(0).integers(0, 1000, (480, 640))


def smoothed_mean(kind, size):
    """Return the mean of the smoothed counts, or None where OpenCV refuses them."""
    kernel = np.full((size, size), 1 / size**2, np.float32)
    try:
        return float(cv2.filter2D(counts.astype(kind), -1, kernel).mean())
    except cv2.error:
        return None


print(f"OpenCV {cv2.__version__}, mean of the counts {counts.mean():.1f}")
for kind in ("uint32", "int32", "uint16", "float32"):
    means = {size: smoothed_mean(kind, size) for size in (3, 7, 9, 15)}
    told = (f"{size}: {'refused' if mean is None else round(mean, 1)}" for size, mean in means.items())
    print(f"{kind:8}", *told)
    for size, mean in means.items():
        if kind == "uint32":
            assert mean == (0.0 if is_new and size > 7 else None)
        elif mean is not None:
            assert abs(mean - counts.mean()) < 1
PYTHON
done
