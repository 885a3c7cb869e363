#!/usr/bin/env bash
# Pillow pastes into a 16-bit picture at half the column that its mask says, and never in the right half.
#
# Software: Pillow 13.0.0 and 11.3.0, with numpy 2.4.6.
#
# Depth maps in millimetres, instance ids and 12-bit pictures come from PNG files as mode `I;16`. A car
# is pasted into one by a mask of mode `L`, 0 and 255, as for an augmentation. `Image.composite`, and
# `paste` of an image, take the two bytes of each pixel for two pixels of the mask. What the mask has in
# the columns 200 to 279 gets into the columns 100 to 139, and nothing to the right of the middle is
# ever changed. Size, mode and both values are those that were asked for, and nothing is raised. The
# colour picture and the label mask, `RGB` and `L`, get the car at the right place by the same call, so
# that labels and depths of one frame no longer belong together.
#
# The same mask as mode `1`, and the modes `L`, `I` and `F` of the picture, are right. Where a number is
# pasted in place of an image, it is the other way round: a mask of mode `L` is right, one of `1` wrong.
#
# Source: the pixels of each. The documentation of `paste` and `composite` offers masks of "1", "L" and
# "RGBA" for pictures of all modes. Pull request 8112 of python-pillow/Pillow, of 2024, made masks of
# mode `1` right for `I;16`.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 13.0.0 11.3.0; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    pillow==$version numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import numpy as np
import PIL
from PIL import Image

SIZE = (240, 320)
car = np.zeros(SIZE, bool)
car[100:140, 200:280] = True
mask = Image.fromarray(np.where(car, np.uint8(255), np.uint8(0)))


def columns(picture, value=3000):
    found = np.flatnonzero((picture == value).any(0))
    return f"columns {found[0]} to {found[-1]}, {(picture == value).sum()} pixels"


print(f"Pillow {PIL.__version__}: a mask of {columns(car, True)}")
for mode, dtype, near, far in (
    ("I;16", np.uint16, 3000, 20000),
    ("I", np.int32, 3000, 20000),
    ("F", np.float32, 3000, 20000),
    ("L", np.uint8, 30, 200),
):
    street, car_depth = (Image.fromarray(np.full(SIZE, value, dtype)) for value in (far, near))
    assert street.mode == mode
    for mask_mode in ("L", "1"):
        soft = mask.convert(mask_mode)
        composed = np.asarray(Image.composite(car_depth, street, soft))
        pasted = street.copy()
        pasted.paste(car_depth, (0, 0), soft)
        assert (np.asarray(pasted) == composed).all()
        number = street.copy()
        number.paste(near, (0, 0), soft)
        is_right = (composed == np.where(car, near, far)).all()
        number_right = (np.asarray(number) == np.where(car, near, far)).all()
        print(f"  {mode}, mask of mode {mask_mode}: image to {columns(composed, near)}", end="; ")
        print(f"number {'right' if number_right else 'wrong'}")
        assert is_right == ((mode, mask_mode) != ("I;16", "L"))
        assert number_right == ((mode, mask_mode) != ("I;16", "1"))
        if not is_right:
            halved = np.zeros(SIZE, bool)
            halved[100:140, 100:140] = True
            assert (composed == np.where(halved, near, far)).all()
whole = Image.fromarray(np.full(SIZE, 255, np.uint8))
street, car_depth = (Image.fromarray(np.full(SIZE, value, np.uint16)) for value in (20000, 3000))
everywhere = np.asarray(Image.composite(car_depth, street, whole))
print(f"  I;16, a mask of 255 everywhere: image to {columns(everywhere)} of {everywhere.size}")
assert (everywhere[:, :160] == 3000).all() and (everywhere[:, 160:] == 20000).all()
PYTHON
done
