#!/usr/bin/env bash
# OpenCV takes an image of 64-bit integers, NumPy's usual ones, and keeps the lower 32 bits of each.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, with numpy 2.4.6.
#
# An image of int64 goes into `flip`, `resize` with INTER_NEAREST, `remap`, `compare` or `countNonZero`
# without an error, and comes back as int32 with the right values, as long as they are small. So label
# images, which NumPy makes as int64, work for months. Ids and times that need more than 31 bits lose
# their upper half, without a word. Ids that join a class and an instance, class * 2**32 + instance,
# come back as the instance alone, so a car and a pedestrian are one object; one with the instance 0
# is no object for `countNonZero`. `compare` calls ids equal that differ in their class. The times of
# an event camera's pixels, in nanoseconds since 1970, come out of a flip as any number between
# -2**31 and 2**31, and the latest one (`minMaxLoc`) is another pixel. uint64 is treated in the same way.
#
# Another type that OpenCV has no place for raises ("data type = float128 is not supported"). OpenCV 5
# has types of 64 bits, CV_64S and CV_64U, and does the same as OpenCV 4. NumPy's own indexing keeps
# all bits, and so does an image of both halves, `image.view(np.int32)` with two channels.
#
# Source: modules/python/src2/cv2_convert.cpp casts arrays of NPY_INT64, NPY_UINT64 and NPY_LONG to
# NPY_INT. The documentation of the functions has no type of the Python side.
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

has_64_bits = hasattr(cv2, "CV_64S")
print("OpenCV", cv2.__version__, "numpy", np.__version__, "CV_64S:", has_64_bits)
assert has_64_bits == cv2.__version__.startswith("5")
SAME = cv2.INTER_NEAREST
PLACES = np.meshgrid(np.arange(4, dtype=np.float32), np.float32([0]))


def through_opencv(image):
    """Return what each function gives for a row of four pixels that it should leave as they are."""
    return {
        "flip": cv2.flip(cv2.flip(image, 1), 1),
        "resize": cv2.resize(image, (4, 1), interpolation=SAME),
        "remap": cv2.remap(image, *PLACES, SAME),
        "copyMakeBorder": cv2.copyMakeBorder(image, 0, 0, 0, 0, cv2.BORDER_REPLICATE),
        "transpose": cv2.transpose(image).T,
    }


for name, result in through_opencv(np.array([[0, 1, 255, 65536]])).items():
    assert result.tolist() == [[0, 1, 255, 65536]] and result.dtype == np.int32, name

CAR, PEDESTRIAN = 1 << 32, 2 << 32
for kind in (np.int64, np.uint64):
    ids = np.array([[CAR + 7, PEDESTRIAN + 7, CAR, 0]], kind)
    for name, result in through_opencv(ids).items():
        assert result.tolist() == [[7, 7, 0, 0]] and result.dtype == np.int32, name
    print(f"{kind.__name__} {ids.tolist()[0]}: {result.tolist()[0]} as {result.dtype}")
    count = cv2.countNonZero(ids)
    print(f"pixels with an object: {np.count_nonzero(ids)} by NumPy, {count} by OpenCV")
    assert np.count_nonzero(ids) == 3 and count == 2
    equal = cv2.compare(ids, np.full_like(ids, CAR + 7), cv2.CMP_EQ) > 0
    assert equal.tolist() == [[True, True, False, False]]

first = 1_764_000_000_000_000_000
times = first + np.array([[0, 1_000_000_000, 2_000_000_000, 3_000_000_000]])
latest = cv2.minMaxLoc(times)[3][0]
print(f"the latest of four times is number {times.argmax()} by NumPy, {latest} by OpenCV")
assert times.argmax() == 3 and latest != 3
assert cv2.flip(times, 1).tolist() == [times[0, ::-1].astype(np.int32).tolist()]

halves = times.view(np.int32).reshape(1, 4, 2)
assert np.array_equal(cv2.flip(halves, 1).view(np.int64)[..., 0], times[:, ::-1])
try:
    cv2.flip(times.astype(np.longdouble), 1)
except cv2.error as error:
    print("longdouble:", str(error).splitlines()[2])
else:
    raise SystemExit("OpenCV takes long doubles now")
PYTHON
done
