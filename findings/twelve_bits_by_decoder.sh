#!/usr/bin/env bash
# The brightest value of one lossless 12-bit picture is 4095 by OpenCV and 65520 by Pillow.
#
# Software: imagecodecs 2026.3.6, OpenCV 5.0.0, Pillow 13.0.0 and PyAV 18.1.0.
#
# A camera, radar or thermal picture of 12 bits is stored without loss, and every decoder gives whole
# numbers of 16 bits or more. OpenCV and imagecodecs give 0 to 4095, as they were written. Pillow gives
# 0 to 65520 for JPEG 2000 (times 16) and 0 to 65535 for PGM (times 65535 / 4095). PyAV is like Pillow,
# and multiplies a lossless JPEG by 16. A 16-bit PNG of the same counts is alike by all, so that a test
# with PNG shows nothing. A threshold, a black level or a scale from counts to degrees that fits one
# reader is wrong by 16 with another, or with the same reader when the log's codec changes. Pillow's
# mode is "I;16" for the PNG and for the JPEG 2000, and nothing else tells which scale it is.
#
# Source: the values of each. JPEG 2000, lossless JPEG and PGM state the 12 bits in their headers.
# Pillow's issue 6202, which is open, asks for the values of a PGM as they are.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  imagecodecs==2026.3.6 opencv-python-headless==5.0.0.93 pillow==13.0.0 av==18.1.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import io

import av
import cv2
import imagecodecs
import numpy as np
import PIL
from PIL import Image

counts = np.arange(4096, dtype=np.uint16).reshape(64, 64)


def by_opencv(data, _):
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


def by_pillow(data, _):
    return np.asarray(Image.open(io.BytesIO(data)))


def by_pyav(data, codec):
    decoder = av.CodecContext.create(codec, "r")
    (frame,) = decoder.decode(av.Packet(data)) + decoder.decode(None)
    return frame.to_ndarray()


def pgm(pixels):
    height, width = pixels.shape
    return b"P5 %d %d 4095\n" % (width, height) + pixels.astype(">u2").tobytes()


def by_imagecodecs(data, codec):
    decode = {
        "jpeg2000": imagecodecs.jpeg2k_decode,
        "mjpeg": imagecodecs.ljpeg_decode,
        "png": imagecodecs.png_decode,
    }
    return decode[codec](data)


FILES = {
    "JPEG 2000": ("jpeg2000", imagecodecs.jpeg2k_encode(counts, reversible=True, bitspersample=12)),
    "lossless JPEG": ("mjpeg", imagecodecs.ljpeg_encode(counts, bitspersample=12)),
    "PGM": ("pgm", pgm(counts)),
    "PNG": ("png", imagecodecs.png_encode(counts)),
}
FACTORS = {
    "JPEG 2000": {by_imagecodecs: 1, by_opencv: 1, by_pillow: 16, by_pyav: 16},
    "lossless JPEG": {by_imagecodecs: 1, by_pyav: 16},
    "PGM": {by_opencv: 1, by_pillow: 65535 / 4095, by_pyav: 65535 / 4095},
    "PNG": {by_imagecodecs: 1, by_opencv: 1, by_pillow: 1, by_pyav: 1},
}
print("imagecodecs", imagecodecs.__version__, "OpenCV", cv2.__version__, end=" ")
print("Pillow", PIL.__version__, "PyAV", av.__version__)
for name, (codec, data) in FILES.items():
    for decode, factor in FACTORS[name].items():
        pixels = decode(data, codec)
        print(f"{name} {decode.__name__}: {pixels.dtype}, brightest {pixels.max()} of 4095")
        assert pixels.dtype == (np.int32 if (name, decode) == ("PGM", by_pillow) else np.uint16)
        assert np.abs(pixels - factor * counts).max() <= 1
PYTHON
