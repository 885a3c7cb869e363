#!/usr/bin/env bash
# imageio and tifffile mix the planes of a one-hot mask in TIFF: what they wrote is not what they read.
#
# Software: imageio 2.38.1, tifffile 2026.3.3; with numpy 2.4.6.
#
# A label map of three or four classes as one-hot planes, bool, (H, W, 3), is written by
# `imageio.v3.imwrite("labels.tif", planes)` without a word, as an RGB picture of one bit a sample. A
# TIFF holds such samples pixel by pixel: red, green, blue, red ... The writer packs eight pixels of one
# plane into a byte, then eight of the next. Each reader, that of the same package, too, takes the
# bits in their order, so that type and shape are right and the planes are mixed: here the road keeps an
# IoU of 0.28 with itself, and a lane marking one of 0.01. Seen as a picture, areas and outlines are
# still there, with colours in stripes. `tifffile.imwrite` does so with `photometric="rgb"`, and is right
# without it; imageio passes that for three and four planes. uint8 is right in all of them.
#
# Source: bits in the file, compared with both orders; TIFF 6.0, PlanarConfiguration 1: "The component
# values for each pixel are stored contiguously".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  imageio==2.38.1 tifffile==2026.3.3 numpy==2.4.6
cd "$folder"
venv/bin/python - <<'PYTHON'
import imageio.v3 as imageio
import numpy as np
import tifffile

HEIGHT, WIDTH = 480, 640
rows, columns = np.mgrid[:HEIGHT, :WIDTH]
half = (rows - 200) * 0.9 + 40
road = (rows >= 200) & (abs(columns - 320) < half)
lane = road & (abs(columns - 320 - (rows - 200) * 0.2) < 3)
sky = rows < 180
planes = np.dstack([road & ~lane, lane, sky])


def tiff(array, **how):
    tifffile.imwrite("labels.tif", array, **how)
    return tifffile.imread("labels.tif")


def by_imageio(array):
    imageio.imwrite("labels.tif", array)
    return imageio.imread("labels.tif")


tifffile.imwrite("labels.tif", planes, photometric="rgb")
with tifffile.TiffFile("labels.tif") as file:
    page = file.pages[0]
    start, size = page.dataoffsets[0], sum(page.databytecounts)
stored = np.fromfile("labels.tif", np.uint8, size, offset=start)
assert np.array_equal(stored, np.packbits(planes, axis=1).ravel()), "eight pixels of a plane a byte"
assert not np.array_equal(stored, np.packbits(planes.reshape(HEIGHT, -1), axis=1).ravel())

ways = {
    "imageio": by_imageio(planes),
    "tifffile, rgb": tiff(planes, photometric="rgb"),
    "tifffile": tiff(planes),
    "uint8": by_imageio(planes.astype(np.uint8)),
}
for words, read in ways.items():
    assert read.shape == planes.shape
    both = (read != 0) & planes
    shares = both.sum((0, 1)) / ((read != 0) | planes).sum((0, 1))
    print(f"{words:14} {str(read.dtype):6} IoU of road, lane, sky:", *np.round(shares, 3))
    is_mixed = words in ("imageio", "tifffile, rgb")
    assert (shares[1] < 0.6) == is_mixed
    assert is_mixed or (shares == 1).all()
PYTHON
