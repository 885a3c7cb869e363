#!/usr/bin/env bash
# imageio repeats pictures of a video where the camera dropped some, and still counts the right number.
#
# Software: imageio 2.38.1 with imageio-ffmpeg 0.8.1, its reader of videos by default; files by PyAV
# 18.1.0, read for comparison by OpenCV 5.0.0.
#
# A camera of 10 Hz dropped two pictures, and the video has the other 30 with their times. OpenCV and
# PyAV give 30, and so does `count_frames()`. Iterating the reader, `imread` and `imiter` give 32: a
# picture beside each gap comes twice. Numbers and pictures are apart by one after the first gap and by
# two after the second, so that labels which go by number slide to other pictures. A pause of two
# seconds makes 50 of 30. It goes the other way as well: after a change to 50 Hz in a Matroska file,
# 30 pictures become 16, and the ones between cannot be had. Nothing is raised. A video with a constant
# rate is read as it is.
#
# `plugin="pyav"` gives each picture once, in order.
#
# Source: the numbers in the pictures. The reader takes the output of the program ffmpeg as raw video,
# which has no times, so that ffmpeg makes the rate constant. imageio's issue 176 (closed) asks for
# videos of variable rate, and was answered that nothing has to be done to read them.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  imageio==2.38.1 imageio-ffmpeg==0.8.1 av==18.1.0 opencv-python-headless==5.0.0.93 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
from fractions import Fraction
from importlib.metadata import version

import av
import cv2
import imageio
import imageio.v3 as iio
import numpy as np

COUNT = 30
MILLISECOND = Fraction(1, 1000)
SPEEDING = [100 * n if n < 10 else 1000 + 20 * (n - 10) for n in range(COUNT)]
CASES = {
    "constant.mp4": ([100 * n for n in range(COUNT)], 30),
    "two dropped.mp4": ([100 * n for n in range(COUNT + 2) if n not in (10, 20)], 32),
    "two dropped.mkv": ([100 * n for n in range(COUNT + 2) if n not in (10, 20)], 32),
    "pause.mp4": ([100 * n + 2000 * (n >= 10) for n in range(COUNT)], 50),
    "to 50 Hz.mkv": (SPEEDING, 16),
}


def write(path, times):
    """Write pictures that are as bright as eight times their number."""
    with av.open(path, "w") as container:
        stream = container.add_stream("libx264", rate=10, options={"bf": "0"})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.codec_context.time_base = MILLISECOND
        for number, time in enumerate(times):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 8 * number, np.uint8))
            frame.pts, frame.time_base = time, MILLISECOND
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def number_of(picture):
    return round(float(np.mean(picture)) / 8)


def by_opencv(path):
    capture = cv2.VideoCapture(path)
    while (read := capture.read())[0]:
        yield number_of(read[1])


print(*(f"{name} {version(name)}" for name in ("imageio", "imageio-ffmpeg", "av")))
for path, (times, given) in CASES.items():
    write(path, times)
    with imageio.get_reader(path) as reader:
        counted = reader.count_frames()
        numbers = [number_of(picture) for picture in reader]
    print(f"{path}: count_frames {counted}, given {len(numbers)}: {numbers}")
    assert counted == COUNT and len(numbers) == given
    assert numbers == [number_of(picture) for picture in iio.imiter(path)]
    in_order = list(range(COUNT))
    assert (numbers == in_order) == path.startswith("constant")
    assert [number_of(picture) for picture in iio.imiter(path, plugin="pyav")] == in_order
    assert list(by_opencv(path)) == in_order
PYTHON
