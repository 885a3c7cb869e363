#!/usr/bin/env bash
# imageio's picture number 20 of a video that begins at two seconds is picture 0.
#
# Software: imageio 2.38.1 with its plugin for PyAV 18.1.0.
#
# A video has 30 pictures at 10 Hz, and the first has the time 2.0 s, as in a clip that was cut out of
# a drive with its times kept, or of a camera that began after the others. `imiter` gives the 30
# pictures. `imread(path, index=n, plugin="pyav")` gives the right one for 0 and for 1, then picture 0
# for every number from 2 to 20, and from there on picture n - 20. The last twenty pictures are had
# by no number below 30. Nothing is raised, and the shape that `improps` states is right. MP4, Matroska,
# H.264 and MJPEG are alike in this. A video that begins at zero is read rightly, which is what a test
# writes, and so is any video whose numbers are asked in order, of one file that `imopen` keeps open.
# With `constant_framerate=False` the numbers are right; by its documentation that is for videos whose
# rate is not constant, and the rate here is.
#
# Source: `_seek` in imageio/plugins/pyav.py takes a picture's number for its time, and does not add
# the start time of the stream.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  imageio==2.38.1 av==18.1.0 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
from fractions import Fraction

import av
import imageio
import imageio.v3 as iio
import numpy as np

COUNT, RATE = 30, 10


def write(path, codec, start):
    """Write pictures that are as bright as eight times their number, from ``start`` s on."""
    with av.open(path, "w") as container:
        stream = container.add_stream(codec, rate=RATE)
        stream.width, stream.height = 64, 48
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        for number in range(COUNT):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 8 * number, np.uint8))
            frame.pts, frame.time_base = start * RATE + number, Fraction(1, RATE)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def number_of(picture):
    return round(float(picture.mean()) / 8)


print("imageio", imageio.__version__, "av", av.__version__)
for path, codec in (("h264.mp4", "libx264"), ("h264.mkv", "libx264"), ("mjpeg.mp4", "mjpeg")):
    for start in (0, 2):
        write(path, codec, start)
        by_order = [number_of(picture) for picture in iio.imiter(path, plugin="pyav")]
        numbers = range(COUNT)
        by_index = [number_of(iio.imread(path, index=n, plugin="pyav")) for n in numbers]
        with iio.imopen(path, "r", plugin="pyav") as file:
            in_order = [number_of(file.read(index=n)) for n in numbers]
        with iio.imopen(path, "r", plugin="pyav") as file:
            counted = [number_of(file.read(index=n, constant_framerate=False)) for n in numbers]
        print(f"{path}, begins at {start} s: by index {by_index}")
        late = start * RATE
        assert by_order == in_order == counted == list(numbers)
        assert by_index == [n if n < 2 else max(n - late, 0) for n in numbers]
PYTHON
