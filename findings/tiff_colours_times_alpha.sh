#!/usr/bin/env bash
# OpenCV multiplies the colours of a TIFF of 8 bits by its fourth channel, also with IMREAD_UNCHANGED.
#
# Software: opencv-python-headless 4.14.0.94 and 5.0.0.93, tifffile 2026.3.3, Pillow 13.0.0; numpy 2.4.6.
#
# A fourth channel may be alpha, or near infrared of an RGB+NIR camera, or a map of confidence or labels
# beside the colours. tifffile calls it "unassociated alpha" for any (H, W, 4) array of uint8, and Pillow
# for RGBA. `cv2.imread` then returns colour * fourth / 255, rounded: where the fourth channel is 0 the
# picture is black, and colours of classes at soft edges are no class's colour any more. It does so with
# IMREAD_UNCHANGED and with IMREAD_COLOR. The same picture as PNG, the same array with 16 bits, a TIFF
# that OpenCV wrote itself and one whose channel has no stated meaning are read as they are, and
# Pillow and tifffile read all of them so. What is dark in near infrared, as asphalt is, gets dark in RGB.
#
# Source: the documentation of IMREAD_UNCHANGED: "If set, return the loaded image as is (with alpha
# channel, otherwise it gets cropped)". Pixels of the file by Pillow and tifffile.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 4.14.0.94 5.0.0.93; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    opencv-python-headless==$version tifffile==2026.3.3 Pillow==13.0.0 numpy==2.4.6
  cd "$folder"
  "$folder/$version/bin/python" - <<'PYTHON'
import cv2
import numpy as np
import tifffile
from PIL import Image

FOURTH = [0, 51, 102, 128, 204, 255]
picture = np.zeros((4, len(FOURTH), 4), np.uint8)
picture[...] = 200, 100, 50, 0
picture[..., 3] = FOURTH


def by_opencv(path, flag=cv2.IMREAD_UNCHANGED):
    """Return a row of the file as red, green, blue and, if there is one, the fourth channel."""
    row = cv2.imread(path, flag)[0]
    return row[:, [2, 1, 0, 3][: row.shape[1]]]


tifffile.imwrite("tifffile.tif", picture)
tifffile.imwrite("unspecified.tif", picture, photometric="rgb", extrasamples=["unspecified"])
tifffile.imwrite("16.tif", picture.astype(np.uint16) * 257)
Image.fromarray(picture).save("pillow.tif")
Image.fromarray(picture).save("pillow.png")
cv2.imwrite("opencv.tif", picture[..., [2, 1, 0, 3]])

print(f"OpenCV {cv2.__version__}; the fourth channel is", *FOURTH)
dimmed = np.rint(picture[0, :, :3] * (np.array(FOURTH)[:, None] / 255))
for name in ("tifffile.tif", "pillow.tif", "unspecified.tif", "16.tif", "opencv.tif", "pillow.png"):
    row = by_opencv(name) // (257 if name == "16.tif" else 1)
    print(f"{name:16} red", *row[:, 0])
    assert row[:, 3].tolist() == FOURTH
    if name in ("tifffile.tif", "pillow.tif"):
        assert abs(row[:, :3] - dimmed).max() <= 1
        assert np.array_equal(by_opencv(name, cv2.IMREAD_COLOR), row[:, :3])
        for other in (np.array(Image.open(name)), tifffile.imread(name)):
            assert np.array_equal(other, picture)
    else:
        assert np.array_equal(row, picture[0])
PYTHON
done
