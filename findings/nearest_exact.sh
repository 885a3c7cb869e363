#!/usr/bin/env bash
# OpenCV's INTER_NEAREST_EXACT takes other pixels in version 5.0 than in 4.14, and neither follows the
# rule for all columns.
#
# Software: opencv-python-headless 4.14.0.94 and 5.0.0.93, Pillow 13.0.0.
#
# Column x of an image that is 480 wide shows column floor((x + 1/2) * 640 / 480) of one that is 640
# wide. Where that product is a whole number, the result depends on how it is rounded on the way:
# version 5.0 takes the column before it in 99 of 480 columns, 4.14 in 160. By halves and by doubling
# all agree. OpenCV's documentation calls the method bit exact and says that it gives the same as
# Pillow; 4.14 does not, 5.0 does. So masks that were made smaller by one version differ from those
# of the other along every upright edge that lies on such a column.
#
# Source: the description of cv::INTER_NEAREST_EXACT (opencv2/imgproc.hpp, InterpolationFlags): "Bit
# exact nearest neighbor interpolation. This will produce same results as the nearest neighbor method
# in PIL, scikit-image or Matlab."
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 4.14.0.94 5.0.0.93; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    "opencv-python-headless==$version" pillow==13.0.0 numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import cv2
import numpy as np
from PIL import Image


def columns(width, wanted, resize):
    """The column of the large image that each column of the small one shows."""
    return resize(np.arange(width, dtype=np.float32)[None].repeat(4, axis=0), wanted)[0]


def by_opencv(image, wanted):
    return cv2.resize(image, (wanted, 4), interpolation=cv2.INTER_NEAREST_EXACT)


def by_pillow(image, wanted):
    return np.asarray(Image.fromarray(image).resize((wanted, 4), Image.Resampling.NEAREST))


def by_rule(width, wanted):
    places = np.arange(wanted, dtype=np.int64)
    return (2 * places + 1) * width // (2 * wanted)


def off(width, wanted, other):
    return int((columns(width, wanted, by_opencv) != other).sum())


from_rule = off(640, 480, by_rule(640, 480))
from_pillow = off(640, 480, columns(640, 480, by_pillow))
halves = off(640, 320, by_rule(640, 320)) + off(320, 640, by_rule(320, 640))
print(f"OpenCV {cv2.__version__}, 640 to 480 columns: {from_rule} differ from the rule, ", end="")
print(f"{from_pillow} from Pillow; by halves and doubling {halves}")
expected = {"4": (160, 61), "5": (99, 0)}[cv2.__version__[0]]
assert (from_rule, from_pillow) == expected
assert halves == 0
PYTHON
done
