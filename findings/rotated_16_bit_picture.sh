#!/usr/bin/env bash
# Pillow's smooth rotation of a 16-bit picture returns values of at most 255, unlike its resizing.
#
# Software: Pillow 13.0.0 and 11.3.0, with numpy 2.4.6.
#
# Depth maps in millimetres and 12-bit camera pictures come from PNG files as mode `I;16`. Pillow
# resizes this mode rightly with every filter. `rotate` by an angle that is no multiple of 90 degrees,
# and `transform` (affine, perspective, quadrilateral, mesh), are right with `NEAREST` alone. With
# `BILINEAR` or `BICUBIC` they take the bytes of a row for its pixels, so that every result has eight
# bits: a road at 3,000 mm lies at 184 mm after a transform that moves nothing, which is its low byte.
# Size, mode and type are those of a right result, and nothing is raised. The same calls are right for
# the modes `L`, `I` (32 bits) and `F`. A depth map that is augmented by a small rotation, or rectified
# by `PERSPECTIVE`, becomes noise of values that look like near ones.
#
# Convert to `I` or `F` before, and back after; or rotate with OpenCV.
#
# Source: the bytes of the results. The documentation of `Image.transform` and `Image.rotate` offers
# the filters for all modes; that of modes says that `I;16` has "limited support". Issue 1127 of
# python-pillow/Pillow, closed, has a perspective of a 16-bit picture that came out black in 2015.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 11.3.0 13.0.0; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    Pillow==$version numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import numpy as np
import PIL
from PIL import Image
from PIL.Image import Resampling, Transform

depth = np.full((64, 64), 3000, np.uint16)  # a road at 3 m, and a wall at 60 m
depth[:, 32:] = 60000
picture = Image.fromarray(depth)
assert picture.mode == "I;16"
identity = (1, 0, 0, 0, 1, 0)

for name in ("NEAREST", "BILINEAR", "BICUBIC"):
    how = Resampling[name]
    results = {
        "resize": picture.resize((64, 48), how),
        "rotate 10": picture.rotate(10, how),
        "transform by nothing": picture.transform((64, 64), Transform.AFFINE, identity, how),
    }
    values = {words: np.asarray(image)[24, [10, 54]].tolist() for words, image in results.items()}
    print(f"Pillow {PIL.__version__}, {name}: {values}")
    assert all(image.mode == "I;16" for image in results.values())
    wrong = [words for words, pair in values.items() if pair != [3000, 60000]]
    assert wrong == ([] if name == "NEAREST" else ["rotate 10", "transform by nothing"])
    assert all(np.asarray(results[words]).max() <= 255 for words in wrong)
    for mode, kind in (("I", np.int32), ("F", np.float32)):
        other = Image.fromarray(depth.astype(kind)).rotate(10, how)
        assert np.asarray(other)[24, [10, 54]].tolist() == [3000, 60000] and other.mode == mode
assert np.array_equal(np.unique(picture.rotate(90, Resampling.BILINEAR)), [3000, 60000])
PYTHON
done
