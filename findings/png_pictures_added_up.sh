#!/usr/bin/env bash
# One PNG decoder of PyAV that reads several files adds each picture to the one before.
#
# Software: PyAV 18.1.0 (with the FFmpeg in its wheels), OpenCV 5.0.0, Pillow 13.0.0.
#
# A topic of compressed images holds complete PNG files, such as label images. One `CodecContext` of
# "png" that is kept for all of them, as it must be for H.264, returns as many pictures as there are
# files. The first is right. Every later one is the sum, modulo 256, of its own pixels and of those
# of the picture returned before: a label of 0 stays 1 where a 1 was before, and two classes make a
# third that is in no file. Nothing is raised, and `is_corrupt` is False. Files of OpenCV and of
# Pillow are alike in this.
#
# The right pixels come where each packet has `is_keyframe = True`, or each file a decoder of its
# own. JPEG files need neither.
#
# Source: libavcodec/pngdec.c of FFmpeg takes a packet without AV_PKT_FLAG_KEY for a difference from
# the picture before; a packet that PyAV makes of bytes has no such flag.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check av==18.1.0 \
  numpy==2.4.6 opencv-python-headless==5.0.0.93 pillow==13.0.0
"$folder/venv/bin/python" - <<'PYTHON'
import io

import av
import cv2
import numpy as np
from PIL import Image


def by_opencv(pixels, ending):
    return cv2.imencode(ending, pixels)[1].tobytes()


def by_pillow(pixels, ending):
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, ending[1:])
    return file.getvalue()


def decode(codec, files, key=False):
    decoder, frames = av.CodecContext.create(codec, "r"), []
    for data in files:
        packet = av.Packet(data)
        if key:
            packet.is_keyframe = True
        frames += decoder.decode(packet)
    frames += decoder.decode(None)
    assert not any(frame.is_corrupt for frame in frames)
    return [frame.to_ndarray() for frame in frames]


pictures = np.zeros((3, 48, 64), np.uint8)
pictures[0, :, :20] = 1  # road at the left
pictures[1, 10:20] = 2  # a class across
pictures[2, :, 40:] = 1  # road at the right
sums = np.add.accumulate(pictures, dtype=np.uint8)

for encode in (by_opencv, by_pillow):
    files = [encode(picture, ".png") for picture in pictures]
    kept = decode("png", files)
    for number, (picture, own) in enumerate(zip(kept, pictures)):
        held, expected = np.unique(picture).tolist(), np.unique(own).tolist()
        print(f"{encode.__name__}: picture {number} has the values {held}, its file {expected}")
    assert np.array_equal(kept, sums)
    assert np.array_equal(decode("png", files, key=True), pictures)
    assert np.array_equal([decode("png", [file])[0] for file in files], pictures)

jpegs = [by_opencv(100 * picture, ".jpeg") for picture in pictures]
assert np.array_equal(decode("mjpeg", jpegs), [decode("mjpeg", [file])[0] for file in jpegs])
PYTHON
