#!/usr/bin/env bash
# oxipng, a lossless optimiser of PNG files, numbers the classes of label images anew, each by itself.
#
# Software: pyoxipng 9.1.1 (oxipng), read by Pillow 13.0.0 and OpenCV 5.0.0; with numpy 2.4.6.
#
# The labels of Pascal VOC, and of many tools, are PNG files with a palette: the index of a pixel is its
# class, and the palette only shows it. `oxipng.optimize` keeps the colour of each pixel, which it calls
# lossless, leaves out colours that do not occur, and sorts the others. So the indices change, already
# at level 0, and as other classes occur in other frames, each frame has numbers of its own. Where the
# sky is seen, road keeps its 2, car becomes 3 and sky 1. Where it is not, road becomes 1, and car gets
# the number of road. Programs that open labels by Pillow, as loaders of VOC do, read these
# numbers, and a network that is trained or scored on them confuses car and road on some frames alone.
# Grey label images get a palette as well: of the classes 3, 7 and 11 Pillow's array has 0, 1 and 2.
# OpenCV reads the colours of a palette, or its greys, and sees no change.
#
# `palette_reduction=False, color_type_reduction=False` keep the indices of both kinds.
#
# Source: the palettes and indices of the files. Its README calls oxipng a "lossless PNG/APNG compression
# optimizer"; its sorting of palettes came with the pull requests 184, 514 and 602 of oxipng/oxipng.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  pyoxipng==9.1.1 pillow==13.0.0 opencv-python-headless==5.0.0.93 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import io
from importlib.metadata import version

import cv2
import numpy as np
import oxipng
from PIL import Image

VOC = [0, 0, 0, 128, 0, 0, 0, 128, 0, 128, 128, 0]  # ground, car, road, sky
frame = np.zeros((48, 64), np.uint8)
frame[:12], frame[30:, 10:50], frame[20:26, 20:30] = 3, 2, 1
without_sky = np.where(frame == 3, 0, frame).astype(np.uint8)
grey = np.array([3, 7, 11, 11], np.uint8)[frame]


def png(labels, palette=None):
    image, file = Image.fromarray(labels), io.BytesIO()
    if palette:
        image.putpalette(palette)
    image.save(file, "PNG")
    return file.getvalue()


def by_pillow(file):
    return np.array(Image.open(io.BytesIO(file)))


def by_opencv(file):
    return cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_COLOR)


def renumbered(words, labels, palette=None):
    """Print and return the number that Pillow reads for each class after the optimiser."""
    before = png(labels, palette)
    after = oxipng.optimize_from_memory(before, level=0)
    assert np.array_equal(by_opencv(before), by_opencv(after))
    assert np.array_equal(by_pillow(before), labels)
    numbers = {}
    for value in np.unique(labels).tolist():
        (numbers[value],) = np.unique(by_pillow(after)[labels == value]).tolist()
    print(f"{words}: {numbers}")
    kept = oxipng.optimize_from_memory(
        before, level=6, palette_reduction=False, color_type_reduction=False
    )
    assert np.array_equal(by_pillow(kept), labels)
    return numbers


print(", ".join(f"{name} {version(name)}" for name in ("pyoxipng", "pillow")))
first = renumbered("with the sky, numbers before and after", frame, VOC)
second = renumbered("without the sky", without_sky, VOC)
assert first == {0: 0, 1: 3, 2: 2, 3: 1}
assert second == {0: 0, 1: 2, 2: 1}
greys = renumbered("grey labels", grey)
assert set(greys) == {3, 7, 11} and set(greys.values()) == {0, 1, 2}
PYTHON
