#!/usr/bin/env bash
# OpenCV 5 takes Boolean masks of NumPy, and its `bitwise_not` of one is True everywhere.
#
# Software: opencv-python-headless 5.0.0.93, against 4.14.0.94, with numpy 2.4.6.
#
# Version 4 refuses an array of bool, so that code for it converts masks to uint8. Version 5 takes
# them: `bitwise_and`, `bitwise_or`, `bitwise_xor`, `max`, `min`, `countNonZero` and the parameter
# `mask` give what NumPy gives. `bitwise_not` turns over all eight bits of each byte, and returns an
# array of bool whose bytes are 255 for False and 254 for True. NumPy takes both for True: the whole
# image is the complement of any mask. Nothing is raised. `np.unique`, `sum`, `all` and indexing agree
# that it is True everywhere, so "what is not road" is every pixel, and the road with it. With masks of
# 0 and 255 in uint8 the same line is right.
#
# `~mask` or `np.logical_not` is right for bool.
#
# Source: the bytes of the result.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 5.0.0.93 4.14.0.94; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    "opencv-python-headless==$version" numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import cv2
import numpy as np

print("OpenCV", cv2.__version__, "NumPy", np.__version__)
road = np.zeros((48, 64), bool)
road[20:, 10:50] = True
car = np.zeros_like(road)
car[25:35, 20:30] = True

as_bytes = np.uint8(255) * road
assert np.array_equal(cv2.bitwise_not(as_bytes) > 0, ~road)
if cv2.__version__.startswith("4"):
    try:
        cv2.bitwise_not(road)
    except cv2.error:
        print("bitwise_not refuses bool")
    else:
        raise AssertionError("version 4 takes bool")
else:
    for name, function, expected in (
        ("bitwise_and", cv2.bitwise_and, road & car),
        ("bitwise_or", cv2.bitwise_or, road | car),
        ("bitwise_xor", cv2.bitwise_xor, road ^ car),
        ("max", cv2.max, road | car),
        ("min", cv2.min, road & car),
    ):
        found = function(road, car)
        print(f"{name}: as NumPy's, {found.dtype}")
        assert found.dtype == bool and np.array_equal(found, expected)
    assert cv2.countNonZero(road) == road.sum()
    grey = np.full(road.shape, 100, np.uint8)
    assert cv2.mean(grey, mask=road)[0] == 100

    other = cv2.bitwise_not(road)
    told = np.unique(other.view(np.uint8)).tolist()
    print(f"bitwise_not: {other.dtype}, {other.sum()} of {other.size} True, bytes {told}", end="; ")
    print(f"by NumPy {(~road).sum()}")
    assert other.dtype == bool and other.all() and other[road].all()
    assert np.unique(other).tolist() == [True]
    assert np.array_equal(other.view(np.uint8), np.where(road, 254, 255))
PYTHON
done
