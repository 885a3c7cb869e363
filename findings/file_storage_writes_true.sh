#!/usr/bin/env bash
# OpenCV 5 writes `true` into a calibration file for every whole number beyond 32 bits.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, with numpy 2.4.6.
#
# A calibration is stored by `cv2.FileStorage`, and with it the time at which it was made, in
# nanoseconds, or the serial number of a camera. `write("stamp", 1764000000123456789)` writes 1 to a
# JSON file and `true` to YAML, and so do 2**31, -2**31 - 1 and every NumPy integer of that size.
# Nothing is raised, and all such values of all cameras are equal afterwards: whatever compares them,
# as to find the newest calibration or the one of this camera, takes any. 2**31 - 1 and smaller ones
# are right, so that a test with small numbers shows nothing. Version 4.14 writes all of these as they
# are, and version 5 reads those files: `FileNode.real()` gives the time as a float.
#
# Numbers of this size can be written as text: `write("stamp", str(stamp))`.
#
# Source: the files. By cv2/__init__.pyi, `FileStorage.write` of version 5 has an overload for bool
# between those for an int of 32 and of 64 bits, and 4.14 has none: bool takes what the first refused.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
for version in 5.0.0.93 4.14.0.94; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    "opencv-python-headless==$version" numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import json
from pathlib import Path

import cv2
import numpy as np

STAMP = 1764000000123456789
NUMBERS = {
    "small": 7,
    "greatest": 2**31 - 1,
    "beyond": 2**31,
    "below": -(2**31) - 1,
    "serial": 4294967297,
    "stamp": STAMP,
    "numpy": np.int64(STAMP),
}


def written(path):
    storage = cv2.FileStorage(path, cv2.FILE_STORAGE_WRITE)
    for name, number in NUMBERS.items():
        storage.write(name, number)
    storage.write("text", str(STAMP))
    storage.release()
    return Path(path).read_text()


version = int(cv2.__version__.split(".")[0])
found = json.loads(written("calibration.json"))
lines = [line for line in written("calibration.yml").splitlines() if "stamp" in line]
print(f"OpenCV {cv2.__version__}: {found}; YAML: {lines}")
assert found.pop("text") == str(STAMP)
fits = {name: -(2**31) <= number < 2**31 for name, number in NUMBERS.items()}
if version == 5:
    assert found == {name: int(NUMBERS[name]) if fits[name] else 1 for name in NUMBERS}
    assert lines == ["stamp: true"]
else:
    assert found == NUMBERS
    assert lines == [f"stamp: {STAMP}"]
PYTHON
done
"$folder/5.0.0.93/bin/python" - <<'PYTHON'
import cv2

storage = cv2.FileStorage("calibration.yml", cv2.FILE_STORAGE_READ)
stamp = storage.getNode("stamp").real()
print(f"OpenCV {cv2.__version__} reads the stamp that 4.14 wrote as {stamp:.0f}")
assert stamp == float(1764000000123456789)
PYTHON
