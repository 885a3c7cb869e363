#!/usr/bin/env bash
# torchvision flips a keypoint by one rule and rotates and resizes it by another: it leaves its pixel.
#
# Software: torchvision 0.29.1 with torch 2.14.1, its `tv_tensors.KeyPoints` (beta).
#
# One pixel of an image is lit, and a keypoint has its column and row, (40, 30). A horizontal flip of
# both, a vertical one, a crop and a pad keep them together: in `KeyPoints` whole numbers are the middle
# of a pixel. A rotation by 180 degrees, which is both flips one after the other, puts the pixel at
# (119, 89) and the keypoint at (120, 90). For a rotation, an affine transform and a resize whole
# numbers are the corners of pixels. So an image that is made four times as large has its pixel at
# 161.5 and its keypoint at 160; one that is rotated by 90 degrees has its points a whole pixel off in one
# direction. The first pixel, (0, 0), comes out of a rotation by 180 degrees at (160, 120), outside an
# image of 160 columns and 120 rows. In training images that are flipped, rotated and resized at random,
# the points of a lane lie now on the one and now on the other side of it.
#
# No convention of one's own mends it: from (40.5, 30.5), the middle by the rule of the corners, the
# rotation and the resize are right, and each flip is wrong by a pixel. `BoundingBoxes` are right
# in all of them, so a point may be carried as a box of one pixel.
#
# Source: torchvision/transforms/v2/functional/_geometry.py has `width - 1 - x` for the flip of
# keypoints, `width / 2` as the centre of their rotation, and the bare ratio of sizes for their
# resize. The documentation of KeyPoints says "X and Y coordinates along the width and height
# dimensions" and not where in a pixel a whole number lies. Issue 529 of
# albumentations-team/AlbumentationsX, open in November 2026, has the like between that library's
# flips and its resize. (The script downloads some gigabytes.)
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  torch==2.14.1 torchvision==0.29.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import torch
import torchvision
from torchvision.transforms.v2 import functional
from torchvision.tv_tensors import BoundingBoxes, Image, KeyPoints

print("torchvision", torchvision.__version__, "torch", torch.__version__)
HEIGHT, WIDTH = 120, 160
COLUMN, ROW = 40, 30
image = torch.zeros(1, HEIGHT, WIDTH)
image[0, ROW, COLUMN] = 1


def points(*coordinates):
    return KeyPoints(torch.tensor([coordinates], dtype=torch.float), canvas_size=(HEIGHT, WIDTH))


def of_pixel(transform):
    """Return the mean column and row of the light in the transformed image."""
    light = transform(Image(image))[0].double()
    rows, columns = (torch.arange(size, dtype=light.dtype) for size in light.shape)
    light = light / light.sum()
    return round(float(light.sum(0) @ columns), 3), round(float(light.sum(1) @ rows), 3)


def of_point(transform, x=COLUMN, y=ROW):
    return tuple(round(value, 3) for value in transform(points(x, y))[0].tolist())


def of_box(transform):
    """Return the middle pixel of the transformed box around the one pixel."""
    box = torch.tensor([[COLUMN, ROW, COLUMN + 1, ROW + 1]], dtype=torch.float)
    box = transform(BoundingBoxes(box, format="XYXY", canvas_size=(HEIGHT, WIDTH)))[0].tolist()
    return round((box[0] + box[2] - 1) / 2, 3), round((box[1] + box[3] - 1) / 2, 3)


def both_flips(value):
    return functional.vertical_flip(functional.horizontal_flip(value))


TRANSFORMS = {
    "horizontal flip": (functional.horizontal_flip, (0, 0)),
    "vertical flip": (functional.vertical_flip, (0, 0)),
    "both flips": (both_flips, (0, 0)),
    "crop": (lambda value: functional.crop(value, 10, 20, 100, 100), (0, 0)),
    "pad": (lambda value: functional.pad(value, 5), (0, 0)),
    "rotate by 180": (lambda value: functional.rotate(value, 180), (1, 1)),
    "rotate by 90": (lambda value: functional.rotate(value, 90, expand=True), (0, 1)),
    "rotate by -90": (lambda value: functional.rotate(value, -90, expand=True), (1, 0)),
    "affine by 180": (lambda value: functional.affine(value, 180, [0, 0], 1, [0, 0]), (1, 1)),
    "resize to 4 times": (lambda value: functional.resize(value, [480, 640]), (-1.5, -1.5)),
    "resize to a quarter": (lambda value: functional.resize(value, [30, 40]), (0.375, 0.375)),
}
for name, (transform, expected) in TRANSFORMS.items():
    pixel, point = of_pixel(transform), of_point(transform)
    off = point[0] - pixel[0], point[1] - pixel[1]
    print(f"{name}: pixel {pixel}, keypoint {point}, off by {off}")
    assert off == expected
    assert of_box(transform) == pixel

# With (0.5, 0.5) for the middle of the first pixel the others are right, and the flips are not.
for name, (transform, expected) in TRANSFORMS.items():
    point, pixel = of_point(transform, COLUMN + 0.5, ROW + 0.5), of_pixel(transform)
    off = point[0] - 0.5 - pixel[0], point[1] - 0.5 - pixel[1]
    flipped = {"horizontal flip": (-1, 0), "vertical flip": (0, -1), "both flips": (-1, -1)}
    assert off == flipped.get(name, (0, 0)), name

corner = of_point(TRANSFORMS["rotate by 180"][0], 0, 0)
print(f"the first pixel, rotated by 180: keypoint {corner} of an image of {WIDTH}x{HEIGHT}")
assert corner == (WIDTH, HEIGHT)
PYTHON
