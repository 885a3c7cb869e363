#!/usr/bin/env bash
# OpenCV writes JPEG 2000 in at most a quarter of the bytes, although it documents "1000", all of them.
#
# Software: opencv-python-headless 4.14.0.94 and 5.0.0.93; with numpy 2.4.6.
#
# `cv2.imwrite("frame.jp2", picture)` has a setting IMWRITE_JPEG2000_COMPRESSION_X1000, from 0 to 1000,
# with a default of 1000 by the documentation: the size of the pixels, so without loss. The default in
# fact is 250. A label map, a mask or a test picture needs less than a quarter of its bytes and comes
# back pixel by pixel, which seems to prove that nothing is lost. A camera's picture needs more, as
# its noise does: here 79 % of the pixels of 8 bits change by up to 9, and those of 16 bits by up
# to 53. Thresholds at a step, colour statistics and hashes of archived frames are then not those
# of the camera. With the setting given as 1000 all come back as they were.
#
# Source: ImwriteFlags in opencv2/imgcodecs.hpp: "The value can be from 0 to 1000. Default is 1000."
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

HEIGHT, WIDTH = 480, 640
rng = np.random.default_rng(0)
slope = np.add.outer(np.arange(HEIGHT) / 4, np.arange(WIDTH) / 8)
labels = np.where(np.arange(HEIGHT)[:, None] > 200, 7, 23).repeat(WIDTH, 1).astype(np.uint8)
pictures = {
    "label map": labels,
    "8 bits": (slope + rng.normal(20, 4, slope.shape)).clip(0, 255).astype(np.uint8),
    "16 bits": (slope * 20 + rng.normal(8000, 100, slope.shape)).astype(np.uint16),
}
EXACT = [cv2.IMWRITE_JPEG2000_COMPRESSION_X1000, 1000]


def stored(picture, settings=()):
    """Return the share of the pixels' bytes that the file takes, and the pixels in it."""
    file = cv2.imencode(".jp2", picture, list(settings))[1]
    return len(file) / picture.nbytes, cv2.imdecode(file, cv2.IMREAD_UNCHANGED)


print(f"OpenCV {cv2.__version__}")
for name, picture in pictures.items():
    share, pixels = stored(picture)
    error = abs(pixels.astype(int) - picture).max()
    changed = np.mean(pixels != picture)
    print(f"{name:9} {share:.2f} of the bytes; {changed:.0%} of the pixels change, by up to {error}")
    if name == "label map":
        assert changed == 0
    else:
        assert 0.2 < share < 0.26
        assert changed > 0.5
    share, pixels = stored(picture, EXACT)
    print(f"{'':9} {share:.2f} with 1000: none" if np.array_equal(pixels, picture) else "lossy")
    assert np.array_equal(pixels, picture)
PYTHON
done
