#!/usr/bin/env bash
# albumentations' ImageCompression damages red as JPEG damages blue, and blue as JPEG damages red.
#
# Software: albumentations 2.0.8 with OpenCV 4.12.0, against Pillow 11.3.0.
#
# `ImageCompression(quality_range=(30, 30))` is given an RGB image, as all transforms of the package
# are, and returns RGB again, so nothing looks wrong. But the image goes to OpenCV's encoder as it
# is, which takes the first channel for blue. The result is, to the last bit, that of a JPEG whose
# red and blue are exchanged before and after. JPEG weighs red and blue differently (0.299 and 0.114
# of the luminance, which is kept best), so details in red light are damaged as those in blue light
# are in a camera's JPEG, and the other way round: on random squares the error of red is that of
# blue. A network that is hardened this way has met neither red lamps nor blue signs as cameras
# write them. Grey images are the same either way, which hides it in a test on grey. Who exchanges
# the channels before and after the transform (`image[..., ::-1]`) has what a camera writes.
#
# Source: the pixels of both, from the same image at the same quality.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  albumentations==2.0.8 opencv-python-headless==4.12.0.88 pillow==11.3.0 numpy==2.2.6
NO_ALBUMENTATIONS_UPDATE=1 "$folder/venv/bin/python" - <<'PYTHON'
import io

import albumentations
import numpy as np
from PIL import Image

QUALITY = 30
RED, BLUE = 0, 2


def as_a_camera_writes(image):
    """Write an RGB image as JPEG and read it, by Pillow."""
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(image)).save(file, "JPEG", quality=QUALITY)
    return np.asarray(Image.open(file))


def error(result, image):
    return float(np.sqrt(((result.astype(float) - image) ** 2).mean()))


transform = albumentations.ImageCompression(quality_range=(QUALITY, QUALITY), p=1)
squares = np.kron(np.random.default_rng(1).integers(0, 2, (16, 16)), np.ones((4, 4))) * 255
errors = {}
for name, channel in (("red", RED), ("blue", BLUE)):
    image = np.zeros((64, 64, 3), np.uint8)
    image[..., channel] = squares
    augmented, camera = transform(image=image)["image"], as_a_camera_writes(image)
    exchanged = as_a_camera_writes(image[..., ::-1])[..., ::-1]
    assert (augmented == exchanged).all()
    assert (augmented != camera).any()
    errors[name] = error(camera, image), error(augmented, image)
    print(f"{name} squares: error {errors[name][0]:.1f} in a JPEG, {errors[name][1]:.1f} augmented")
assert errors["red"][0] < errors["blue"][0]
assert errors["red"][1] > errors["blue"][1]
grey = np.repeat(squares.astype(np.uint8)[..., None], 3, axis=2)
assert (transform(image=grey)["image"] == as_a_camera_writes(grey)).all()
print("grey squares: the same in both")
PYTHON
