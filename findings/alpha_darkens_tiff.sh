#!/usr/bin/env bash
# OpenCV reads one RGBA picture right from a PNG file, and from a TIFF file with colours times alpha.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, with Pillow 13.0.0 and numpy 2.4.6.
#
# A picture has colours and a fourth channel: how sure each pixel is, the car's own bonnet, or where a
# stitched view has data. Pillow writes it as TIFF with the tag for colours that are not multiplied by
# the alpha, and reads it back as it was. `cv2.imread` returns the alpha as it is in the file, and
# colours that it has multiplied by it: 200 is 100 where alpha is 128, and 0 where it is 0. It does so
# with IMREAD_UNCHANGED, and with IMREAD_COLOR, whose result has no alpha that tells why a part of the
# picture is black. From PNG it returns the colours of the same picture unchanged by both. Of a TIFF
# file with 16 bits, IMREAD_UNCHANGED returns the colours as they are, and IMREAD_COLOR multiplied. A
# network or a threshold for road sees shadows that the data set had not before its files were TIFF.
# Files that OpenCV writes lack the tag, so that a round trip through it shows nothing.
#
# Pillow and tifffile return the colours as they are.
#
# Source: the pixels of each. TIFF 6.0 has two values of ExtraSamples, 1 for colours that were multiplied
# by alpha and 2 for those that were not. The documentation of imread says of IMREAD_UNCHANGED: "return
# the loaded image as is (with alpha channel, otherwise it gets cropped)".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 5.0.0.93 4.14.0.94; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    opencv-python-headless==$version pillow==13.0.0 tifffile==2026.3.3 numpy==2.4.6
  (cd "$folder" && "$folder/$version/bin/python" -) <<'PYTHON'
import cv2
import numpy as np
import PIL
import tifffile
from PIL import Image

picture = np.empty((4, 256, 4), np.uint8)
picture[..., :3] = 200, 150, 100
picture[..., 3] = np.arange(256)
Image.fromarray(picture).save("picture.png")
Image.fromarray(picture).save("picture.tif")
wide = picture.astype(np.uint16) * 257
tifffile.imwrite("wide.tif", wide, photometric="rgb", extrasamples=["unassalpha"])
with tifffile.TiffFile("picture.tif") as file:
    assert file.pages[0].extrasamples == (2,), file.pages[0].extrasamples
for name in ("picture.png", "picture.tif"):
    assert (np.asarray(Image.open(name)) == picture).all()
assert (tifffile.imread("picture.tif") == picture).all() and (tifffile.imread("wide.tif") == wide).all()

alpha = picture[..., 3:].astype(float) / 255
FLAGS = {"IMREAD_UNCHANGED": cv2.IMREAD_UNCHANGED, "IMREAD_COLOR": cv2.IMREAD_COLOR}
print(f"OpenCV {cv2.__version__}, a red of 200 with an alpha of 0, 128 and 255")
for name in ("picture.png", "picture.tif", "wide.tif"):
    for words, flag in FLAGS.items():
        read = cv2.imread(name, flag)
        colours = read[..., 2::-1].astype(float) / (257 if read.dtype == np.uint16 else 1)
        times_alpha = np.abs(colours - picture[..., :3] * alpha).max() < 1.01
        as_it_is = (colours == picture[..., :3]).all()
        red = ", ".join(f"{colours[0, column, 0]:g}" for column in (0, 128, 255))
        print(f"  {name}, {words}: {red} ({read.shape[2]} channels of {read.dtype})")
        assert times_alpha != as_it_is
        assert times_alpha == (name == "picture.tif" or name == "wide.tif" and words == "IMREAD_COLOR")
        if words == "IMREAD_UNCHANGED":
            assert (read[..., 3] == (wide if name == "wide.tif" else picture)[..., 3]).all()
PYTHON
done
