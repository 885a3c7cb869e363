#!/usr/bin/env bash
# OpenCV 5 adds 1 to an image of uint32, and 16,777,217 becomes 16,777,216.
#
# Software: opencv-python-headless 5.0.0.93, against 4.14.0.94; numpy 2.4.6.
#
# OpenCV 5 takes images of uint32, which OpenCV 4 refuses, so ids of 32 bits need no detour: four bytes of
# a rendered instance image, or a checksum. `cv2.add(ids, 1)`, which makes room for the background,
# computes in float32, as `subtract` and `absdiff` with a number do. From 2**24 on only every second
# whole number exists in float32, and from 2**27 on every 16th. Of the ids of eight instances in a row
# three are left at 2**24, and one at 2**27: different objects run together, and `subtract` of the
# same number does not bring them back. Adding 0 changes ids, too.
#
# The same sum is right with an image in place of the number, `cv2.add(ids, np.full_like(ids, 1))`, for
# int32, and with `dtype=cv2.CV_64F`. `max`, `inRange` and `compare` with a number are right.
#
# Source: the values of one row. The documentation of add says that a scalar is added to each element,
# and that the result has the type of the image unless `dtype` says otherwise. Other faults of the new
# types are open as issues of opencv/opencv in November 2026 (29996, 30002).
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

print("OpenCV", cv2.__version__, "numpy", np.__version__)


def ids_from(first, kind=np.uint32):
    """Return a row of the ids of eight instances."""
    return np.arange(first, first + 8).astype(kind).reshape(1, 8)


if cv2.__version__.startswith("4"):
    try:
        cv2.add(ids_from(0), 1)
    except cv2.error as error:
        print("uint32:", str(error).splitlines()[2])
    else:
        raise SystemExit("OpenCV 4 takes uint32 now")
    raise SystemExit(0)

for first, left in ((2**24 - 8, 8), (2**24, 3), (2**27, 1), (2**30, 1)):
    ids = ids_from(first)
    by_number = cv2.add(ids, 1)
    by_image = cv2.add(ids, np.full_like(ids, 1))
    print(f"{ids[0, 0]} to {ids[0, -1]}, plus 1: {by_number[0].tolist()}")
    assert by_number.dtype == np.uint32
    assert np.array_equal(by_image, ids + 1)
    assert np.array_equal(by_number, (ids.astype(np.float32) + np.float32(1)).astype(np.uint32))
    assert len(set(by_number[0].tolist())) == left
    assert np.array_equal(by_number, ids + 1) == (first < 2**24)
    assert np.array_equal(cv2.add(ids_from(first, np.int32), 1), ids + 1)
    assert np.array_equal(cv2.add(ids, 1, dtype=cv2.CV_64F), ids + 1.0)
    assert np.array_equal(cv2.max(ids, first + 1), np.maximum(ids, first + 1))
    assert (cv2.inRange(ids, first + 1, first + 1) > 0).tolist() == (ids == first + 1).tolist()
    assert (cv2.compare(ids, first + 1, cv2.CMP_EQ) > 0).tolist() == (ids == first + 1).tolist()

ids = ids_from(2**24)
assert cv2.add(ids, 1)[0, 1] == cv2.add(ids, 1)[0, 0] == 16_777_216
for name, result in (
    ("add 0", cv2.add(ids, 0)),
    ("subtract 0", cv2.subtract(ids, 0)),
    ("absdiff with 0", cv2.absdiff(ids, 0)),
    ("add 1, subtract 1", cv2.subtract(cv2.add(ids, 1), 1)),
):
    changed = int((result != ids).sum())
    print(f"{name}: {changed} of {ids.size} ids from 2**24 on are others")
    assert changed > 0
PYTHON
done
