#!/usr/bin/env bash
# tifffile and imageio write True as black into a TIFF: Pillow and OpenCV read such a mask inverted.
#
# Software: tifffile 2026.3.3, imageio 2.38.1, Pillow 13.0.0, OpenCV 5.0.0; with numpy 2.4.6.
#
# `imwrite("road.tif", mask)` with a mask of type bool stores one bit a pixel, 1 for True, and states
# for a black-and-white picture that 0 is white (PhotometricInterpretation 0, "MinIsWhite"). All other
# arrays are stored with 0 as black. tifffile itself does not heed that statement, and gives the mask
# back as it was, so that a test of one's own writing and reading passes. Pillow and OpenCV heed it, as
# do viewers: there is road where none was, and none where it was. imageio writes TIFF by tifffile
# unless told otherwise, and reads the file in either way, by its plugin. Nothing is raised or warned of.
# Whoever scores such a mask by another program has the score of its inverse.
#
# The same mask as PNG, as `uint8`, or with `photometric="minisblack"` is read alike by all of them.
#
# Source: TiffWriter.write in tifffile/tifffile.py sets MINISWHITE where the data is "bilevel". Its
# documentation says that the default "is inferred from the data shape, dtype, and the `colormap`
# argument", and not what it is for bool.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  tifffile==2026.3.3 imageio==2.38.1 pillow==13.0.0 opencv-python-headless==5.0.0.93 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
from importlib.metadata import version

import cv2
import imageio.v3 as imageio
import numpy as np
import tifffile
from PIL import Image

road = np.zeros((48, 64), bool)
road[30:, 10:50] = True

READERS = {
    "tifffile": tifffile.imread,
    "imageio": imageio.imread,
    "imageio, Pillow": lambda path: imageio.imread(path, plugin="pillow"),
    "Pillow": lambda path: np.array(Image.open(path)),
    "OpenCV": lambda path: cv2.imread(path, cv2.IMREAD_UNCHANGED),
}
WRITERS = {
    "tifffile.tif": lambda path: tifffile.imwrite(path, road),
    "imageio.tif": lambda path: imageio.imwrite(path, road),
    "black.tif": lambda path: tifffile.imwrite(path, road, photometric="minisblack"),
    "uint8.tif": lambda path: tifffile.imwrite(path, road.astype(np.uint8)),
    "imageio.png": lambda path: imageio.imwrite(path, road),
}
packages = ("tifffile", "imageio", "pillow", "opencv-python-headless")
print(", ".join(f"{name} {version(name)}" for name in packages))
print(f"{road.sum()} of {road.size} pixels are road")
for path, write in WRITERS.items():
    write(path)
    counts = {}
    for name, read in READERS.items():
        if path.endswith(".tif") or name != "tifffile":
            mask = read(path) > 0
            counts[name] = int(mask.sum())
            heeds = name not in ("tifffile", "imageio")
            is_inverse = heeds and path in ("tifffile.tif", "imageio.tif")
            assert np.array_equal(mask, road ^ is_inverse), (path, name)
    print(f"{path}: {', '.join(f'{name} {count}' for name, count in counts.items())}")
PYTHON
