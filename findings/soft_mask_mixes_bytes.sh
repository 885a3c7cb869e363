#!/usr/bin/env bash
# Pillow mixes depths of 1 m and 1.1 m half and half by a soft mask into 1.178 m, and 1 m and 3 m into 3.5 m.
#
# Software: Pillow 13.0.0 and 11.3.0, with numpy 2.4.6.
#
# `Image.composite` and `Image.paste` with a mask of mode `L` lay one picture over another, with a soft
# edge where the mask is between 0 and 255. They mix the bytes of each pixel, not its value. A byte is
# a value for `L` and `RGB`, and so these are right within a half. In the modes of depth maps and of
# scores, `I` and `F`, it is a part of a number. A half of 1000 mm and a half of 1100 mm is 1178 mm in
# `I`, as each byte is rounded for itself, and half a step of the second byte is 128. In `F` a half of
# 1000 and a half of 3000 is 3492, as parts of the exponent are mixed. With a mask that rises evenly
# from 0 to 255, nearly all results in `I` lie outside the two values that were mixed: an edge that was
# to be smooth has a spike. A mask of 0 and 255 alone is right, so a test with a hard edge passes.
# Nothing is raised, where `Image.blend` refuses these modes ("image has wrong mode").
#
# NumPy mixes rightly. (`I;16` has a fault of its own: see pasted_at_half_the_column.sh.)
#
# Source: the pixels of each. The documentation of `paste` says that intermediate values "will mix the
# two images together", for every mode.
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

mask = np.arange(256, dtype=np.uint8)[None]
TYPES = {"L": np.uint8, "I": np.int32, "F": np.float32}
DEPTHS = (("L", 100, 110), ("I", 1000, 1100), ("F", 1000.0, 3000.0))


def mix(mode, far, near, weights=mask):
    over, under = (Image.fromarray(np.full((1, 256), value, TYPES[mode])) for value in (far, near))
    assert over.mode == under.mode == mode
    soft = Image.fromarray(weights)
    result = Image.composite(over, under, soft)
    pasted = under.copy()
    pasted.paste(over, (0, 0), soft)
    assert (np.asarray(result) == np.asarray(pasted)).all()
    return np.asarray(result, np.float64)[0]


print(f"Pillow {PIL.__version__}")
for mode, near, far in DEPTHS:
    mixed = mix(mode, far, near)
    right = near + (far - near) * (mask[0] / 255)
    outside = ((mixed < near) | (mixed > far)).mean()
    print(
        f"  mode {mode}: {near} and {far} half and half are {mixed[128]:g}; at most"
        f" {np.abs(mixed - right).max():g} off, {outside:.0%} of the mask's steps outside of both"
    )
    assert mixed[0] == near and mixed[255] == far
    assert (np.abs(mixed - right).max() < 1) == (mode == "L")
    assert (outside > 0.1) == (mode != "L")
    hard = np.where(mask > 127, np.uint8(255), np.uint8(0))
    assert (mix(mode, far, near, hard) == np.where(hard[0] == 255, far, near)).all()
    try:
        Image.blend(*(Image.fromarray(np.zeros((2, 2), TYPES[mode])) for _ in "ab"), 0.5)
        assert mode == "L"
    except ValueError as error:
        assert mode != "L" and "wrong mode" in str(error)
PYTHON
done
