#!/usr/bin/env bash
# scikit-image's `denoise_bilateral` of a 16-bit picture is a plain blur that keeps no edge at all.
#
# Software: scikit-image 0.26.0 and 0.25.2, with numpy 2.4.6.
#
# A bilateral filter takes out noise and keeps edges. An edge between the levels 60 and 180 with noise
# stays 60 on one side and 180 on the other as 8 bits or as floats from 0 to 1. As 16 bits, the very
# same picture times 257, it comes back as a ramp over many pixels, with 105 and 107 beside the edge,
# and a lane marking of 5 pixels has no pixel left above half of its contrast, of 100 % before. The
# colour distance that is allowed, `sigma_color`, changes nothing there: 0.05 and 100 give one result,
# bit by bit. int16 and 12 bits in uint16, as cameras give them, are blurred in the same way. Noise goes
# down as hoped, which is what one looks at. The same call is right after `skimage.util.img_as_float`.
#
# Source: `denoise_bilateral` in skimage/restoration/_denoise.py takes the greatest value before the
# picture is converted to 0 to 1, and spreads a table of 10,000 weights (`bins`) from 0 to that. With
# 16 bits all differences of 0 to 1 lie in its first entry. The documentation says that "if the image
# is any `int` type" it is converted, and "the standard deviation is in respect to the range [0, 1]".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 0.26.0 0.25.2; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    scikit-image==$version numpy==2.4.6
  "$folder/$version/bin/python" - <<'PYTHON'
import numpy as np
import skimage
from skimage.restoration import denoise_bilateral
from skimage.util import img_as_float

random = np.random.default_rng(0)
scene = np.full((40, 90), 60.0)
scene[:, 45:] = 180
scene[:, 20:25] = 180  # a lane marking, 5 pixels wide
bytes_ = np.clip(np.rint(scene + random.normal(0, 4, scene.shape)), 0, 255).astype(np.uint8)
sixteen = bytes_.astype(np.uint16) * 257
pictures = {
    "uint8": (bytes_, 255),
    "float64": (bytes_ / 255, 255),
    "uint16": (sixteen, 255),
    "uint16 of 12 bits": (bytes_.astype(np.uint16) * 16, 65535 / 16),
    "int16": (bytes_.astype(np.int16) * 128, 32767 / 128),
    "uint16 by img_as_float": (img_as_float(sixteen), 255),
}


def filtered(picture, levels, sigma_color=0.1):
    result = denoise_bilateral(picture, sigma_color=sigma_color, sigma_spatial=3, mode="edge")
    return result * levels


assert np.allclose(sixteen / 65535, bytes_ / 255)  # one picture
print(f"scikit-image {skimage.__version__}")
for name, (picture, levels) in pictures.items():
    result = filtered(picture, levels)
    dark, bright = result[:, 44].mean(), result[:, 45].mean()
    marking = (result[:, 20:25] > 120).mean()
    noise = result[5:35, 68:80].std()
    print(f"{name}: {dark:.0f} and {bright:.0f} beside the edge,", end=" ")
    print(f"{marking:.0%} of the marking above 120, noise of 4 levels left {noise:.1f}")
    blurred = "16" in name and "float" not in name
    assert bright - dark < 10 if blurred else bright - dark > 115
    assert marking == (0 if blurred else 1)
    assert noise < 1

alike = np.array_equal(filtered(sixteen, 255, 0.05), filtered(sixteen, 255, 100.0))
print("16 bits: sigma_color of 0.05 and of 100 give the same:", alike)
assert alike
PYTHON
done
