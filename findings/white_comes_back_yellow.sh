#!/usr/bin/env bash
# White that goes through OpenCV's XYZ and back is yellow, and red through its YUV is darker, as 8 bits.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, against scikit-image 0.26.0; numpy 2.4.6.
#
# Colour spaces are used to change one property of a picture, such as its brightness, and then to go
# back. OpenCV stores the Z of XYZ in 8 bits without scaling, where that of white is 278 and becomes 255.
# So white, 255, comes back as blue 231, green 254 and red 255, and greys above 235 get a tint: lane paint
# in the sun has a saturation of up to 24 in HSV, where it had none, and a limit of 20 for "white" drops
# it. All greys below are right to a few levels. In YUV it is V that has no room:
# that of red is 284, and red 255 comes back as 221 with some green in it, as do all bright reds, of lamps
# and signs. YCrCb, the same with smaller factors, is right to one level. 16 bits lose the same share.
# float32 keeps all.
#
# OpenCV's XYZ is also another one than scikit-image's: it is computed without sRGB's gamma, though
# OpenCV's Lab is with it. The Y of grey 128 is 0.50 by OpenCV and 0.22 by scikit-image.
#
# Source: documentation of OpenCV's colour conversions: for XYZ, "X, Y and Z cover the whole value range
# (in case of floating-point images, Z may exceed 1)". For YUV it gives no range at all.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 5.0.0.93 4.14.0.94; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    opencv-python-headless==$version scikit-image==0.26.0 numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import cv2
import numpy as np
from skimage.color import rgb2xyz


def there_and_back(picture, space):
    there = cv2.cvtColor(picture, getattr(cv2, f"COLOR_BGR2{space}"))
    return cv2.cvtColor(there, getattr(cv2, f"COLOR_{space}2BGR"))


print(f"OpenCV {cv2.__version__}")
white = np.full((1, 1, 3), 255, np.uint8)
red = np.array([[[0, 0, 255]]], np.uint8)
greys = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
level = np.arange(0, 256, 5, dtype=np.uint8)
colours = np.stack(np.meshgrid(level, level, level), -1).reshape(1, -1, 3)

for space in ("XYZ", "YUV", "YCrCb"):
    error = np.abs(there_and_back(colours, space).astype(int) - colours).max(-1)
    told = f"white {there_and_back(white, space).ravel()}, red {there_and_back(red, space).ravel()}"
    print(f"{space}: {told}, greatest error {error.max()}, {(error > 2).mean():.1%} above 2")
    assert error.max() <= 1 if space == "YCrCb" else error.max() > 20
    as_floats = colours.astype(np.float32) / 255
    assert np.abs(there_and_back(as_floats, space) - as_floats).max() < 0.1 / 255
assert there_and_back(white, "XYZ").ravel().tolist() == [231, 254, 255]
assert there_and_back(red, "YUV").ravel().tolist() == [1, 17, 221]

back = there_and_back(greys, "XYZ")
tint = np.ptp(back.astype(int), axis=2)[0]
saturation = cv2.cvtColor(back, cv2.COLOR_BGR2HSV)[0, :, 1]
print(f"greys through XYZ: tint of 235 {tint[235]}, 245 {tint[245]}, 255 {tint[255]};", end=" ")
print(f"saturation of white {saturation[255]}, greatest of 100 to 234 {saturation[100:235].max()}")
assert tint[:235].max() <= 3
assert tint[255] == 24
assert saturation[255] == 24
assert saturation[100:235].max() < 6

for name, colour, space in (("white", white, "XYZ"), ("red", red, "YUV")):
    sixteen = colour.astype(np.uint16) * 257
    lost = np.abs(there_and_back(sixteen, space).astype(int) - sixteen).max()
    print(f"16 bits: {name} through {space} is off by {lost} of 65535")
    assert lost > 6000

grey = np.full((1, 1, 3), 128, np.uint8)
by_opencv = cv2.cvtColor(grey, cv2.COLOR_BGR2XYZ)[0, 0, 1] / 255
by_skimage = rgb2xyz(grey)[0, 0, 1]
print(f"Y of grey 128: {by_opencv:.2f} by OpenCV, {by_skimage:.2f} by scikit-image")
assert abs(by_opencv - 0.50) < 0.01
assert abs(by_skimage - 0.22) < 0.01
PYTHON
done
