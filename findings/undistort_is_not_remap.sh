#!/usr/bin/env bash
# OpenCV 5's `undistort` is no longer the `remap` that it is documented to be: `remap` became exact.
#
# Software: opencv-python-headless 5.0.0.93, against 4.14.0.94; with numpy 2.4.6.
#
# `cv2.undistort`, `cv2.remap` with the two maps of floats of `initUndistortRectifyMap`, and `remap`
# with its packed maps of whole numbers (CV_16SC2) give the same picture in version 4, but for a pixel
# here and there: all of them round places in the picture to 1/32 of a pixel. In version 5 `remap`
# with maps of floats, `warpAffine` and `warpPerspective` compute with the exact place, and are right to
# half a grey level. `undistort` and packed maps round as before. So a pipeline that undistorts logs by
# maps, and a camera node that calls `undistort` or packs its maps for speed, agree after an update no
# more: here on one pixel in seven. A mask at a threshold, a hash, a golden picture, and colours that
# were learnt from one and are looked up in the other differ. A shift by 0.015 pixels, which version 4
# returns unmoved, changes pixels in version 5.
#
# Source: the documentation of `undistort` in both versions: "The function is simply a combination of
# initUndistortRectifyMap (with unity R) and remap (with bilinear interpolation)."
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 4.14.0.94 5.0.0.93; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    opencv-python-headless==$version numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import cv2
import numpy as np

is_new = cv2.__version__.startswith("5")
width, height = 640, 480
# Smooth texture, made of whole numbers, so that it is the same on each machine.
noise = np.random.default_rng(0).integers(0, 256, (height // 4, width // 4)).astype(float)
picture = np.kron(noise, np.ones((4, 4)))
for axis in (0, 1):
    picture = sum(np.roll(picture, step, axis) for step in range(-2, 3)) / 5
picture = np.rint(picture).astype(np.uint8)
camera = np.array([[500, 0, 320], [0, 500, 240], [0, 0, 1.0]])
lens = np.array([-0.3, 0.1, 0.001, 0.002, 0])

maps = cv2.initUndistortRectifyMap(camera, lens, None, camera, (width, height), cv2.CV_32FC1)
packed = cv2.initUndistortRectifyMap(camera, lens, None, camera, (width, height), cv2.CV_16SC2)
results = {
    "undistort": cv2.undistort(picture, camera, lens),
    "remap, packed maps": cv2.remap(picture, *packed, cv2.INTER_LINEAR),
    "remap, maps of floats": cv2.remap(picture, *maps, cv2.INTER_LINEAR),
}

x, y = (plane.astype(float) for plane in maps)
left, top = np.floor(x).astype(int), np.floor(y).astype(int)
inside = (left >= 0) & (left < width - 1) & (top >= 0) & (top < height - 1)
x, y, left, top = (plane[inside] for plane in (x, y, left, top))
exact = sum(
    picture[top + down, left + right] * abs(1 - right - (x - left)) * abs(1 - down - (y - top))
    for down in (0, 1)
    for right in (0, 1)
)
print(f"OpenCV {cv2.__version__}")
shares = {}
for words, result in results.items():
    error = np.abs(result[inside] - exact).max()
    shares[words] = (result != results["undistort"]).mean()
    print(f"  {words}: at most {error:.2f} levels from bilinear, {shares[words]:.1%} not as undistort")
    assert (error < 0.51) == (is_new and words == "remap, maps of floats"), error
assert shares["remap, packed maps"] < 0.001
assert (shares["remap, maps of floats"] > 0.05) == is_new

shift = np.array([[1, 0, 0.015], [0, 1, 0]])
moved = cv2.warpAffine(picture, shift, (width, height), borderMode=cv2.BORDER_REPLICATE)
print(f"  shifted by 0.015 pixels: {(moved != picture).mean():.1%} of the pixels change")
assert (moved != picture).any() == is_new
PYTHON
done
