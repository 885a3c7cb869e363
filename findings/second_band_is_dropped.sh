#!/usr/bin/env bash
# Pillow 13 opens a TIFF of two bands as its first band, as OpenCV does; Pillow 12 refuses the file.
#
# Software: Pillow 13.0.0 and 12.3.0, OpenCV 5.0.0, with numpy 2.4.6; files by tifffile 2026.3.3.
#
# The scores of a network of two classes, ground and road, are saved as a TIFF of two bands: 255 in the one
# where there is ground, in the other where there is road. Pillow 12 says "cannot identify image file".
# Pillow 13 returns an image of mode `L`, which has the first band; `n_frames` is 1, and nothing tells
# of the second but the tag SamplesPerPixel. A program that takes it for the mask of the road has the
# ground in its place, and one that was protected by the exception is no more. The order of the
# bands decides: with road first the mask is right. `cv2.imread` has the first band, too, also where it is
# asked for the file unchanged. tifffile gives both bands, and so does rasterio, whose files are alike.
# Two bands of 16 bits or of fractions are refused by both versions of Pillow.
#
# Source: the values of the images. Baseline TIFF lets a reader ignore samples that the tag ExtraSamples
# calls unspecified, and the notes of Pillow 5.1.0 say that it discards them in RGB, YCbCr and CMYK. With
# these the first three or four bands are an image by themselves; of two grey ones either may be meant.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 12.3.0 13.0.0; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    pillow==$version numpy==2.4.6 tifffile==2026.3.3 opencv-python-headless==5.0.0.93
  (cd "$folder" && "$folder/$version/bin/python" - 2>/dev/null) <<'PYTHON'
import cv2
import numpy as np
import PIL
import tifffile
from PIL import Image, UnidentifiedImageError

road = np.zeros((48, 64), np.uint8)
road[30:, 10:50] = 255
ground = 255 - road


def opened(*bands):
    """Return the image that Pillow makes of some bands, in words and as an array."""
    layout = {"photometric": "minisblack", "planarconfig": "contig"}
    tifffile.imwrite("bands.tif", np.stack(bands, 2), **layout)
    assert np.array_equal(tifffile.imread("bands.tif"), np.stack(bands, 2))
    try:
        image = Image.open("bands.tif")
    except UnidentifiedImageError:
        return "refused", None
    return f"mode {image.mode}, {image.n_frames} frame", np.array(image)


is_new = PIL.__version__.startswith("13")
words, pixels = opened(ground, road)
assert np.array_equal(cv2.imread("bands.tif", cv2.IMREAD_UNCHANGED), ground)
print(f"Pillow {PIL.__version__}, ground and road: {words}")
assert (pixels is not None) == is_new
if is_new:
    print(f"  {np.count_nonzero(pixels)} pixels are set, {np.count_nonzero(road)} are road")
    assert np.array_equal(pixels, ground)
    assert np.array_equal(opened(road, ground)[1], road)
assert opened(ground.astype(np.uint16), road.astype(np.uint16))[1] is None
PYTHON
done
