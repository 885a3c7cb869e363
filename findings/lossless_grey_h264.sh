#!/usr/bin/env bash
# A lossless H.264 video of grey label images comes back with the classes 0 to 16 all made 0.
#
# Software: PyAV 18.1.0 (with the FFmpeg, libx264 and libx265 in its wheels), OpenCV 5.0.0.
#
# Label images are written as a video, with the pixel format `gray` and the lossless mode of the
# encoder, and read with `to_ndarray(format="gray")`, to which `format="rgb24"`, `to_image` and
# OpenCV's VideoCapture are alike. With H.265 or FFV1 every value from 0 to 255 comes back as it was.
# With H.264 the same lines of code give 0 for 0 to 16, 255 for 235 and above, and stretch what lies
# between: a road mask of 0 and 1 is empty, a mask of 0 and 255 is unharmed, so that a test with 255
# does not show it. Nothing is raised, and the format that the encoder was given is the one that it
# states. The values in the file are exact: the first plane of the frame has them all.
#
# FFmpeg's decoder gives grey H.264 out as yuv420p, which without a stated range means 16 to 235, and
# grey H.265 as gray, which means 0 to 255, whatever range is stated: that file states the narrow one.
# `color_range = 2` on the encoder's context makes H.264 come back exactly.
#
# Source: the pixels of each, and `format` and `color_range` of the frames.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  av==18.1.0 opencv-python-headless==5.0.0.93 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import av
import cv2
import numpy as np

WIDTH, HEIGHT = 64, 48
LOSSLESS = {"libx264": {"qp": "0"}, "libx265": {"x265-params": "lossless=1:log-level=none"}, "ffv1": {}}
CLASSES = np.arange(256)
labels = np.repeat(CLASSES.astype(np.uint8), WIDTH * HEIGHT // 256).reshape(HEIGHT, WIDTH)


def write(codec, full_range=False):
    with av.open("labels.mkv", "w") as container:
        stream = container.add_stream(codec, rate=10, options=LOSSLESS[codec])
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "gray"
        if full_range:
            stream.codec_context.color_range = 2
        for number in range(3):
            frame = av.VideoFrame.from_ndarray(labels, format="gray")
            frame.pts = number
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
        assert stream.pix_fmt == "gray"


def read():
    """Return the class that each class became, by three ways to read."""
    with av.open("labels.mkv") as container:
        frame = next(container.decode(video=0))
    plane = np.frombuffer(frame.planes[0], np.uint8).reshape(HEIGHT, -1)[:, :WIDTH]
    ok, by_opencv = cv2.VideoCapture("labels.mkv").read()
    assert ok
    print(f"  frame: {frame.format.name}, color_range {int(frame.color_range)}")
    assert np.array_equal(plane, labels)
    pictures = {
        "gray": frame.to_ndarray(format="gray"),
        "rgb24": frame.to_ndarray(format="rgb24")[..., 0],
        "OpenCV": by_opencv[..., 0],
    }
    return {name: picture.reshape(256, -1)[:, 0] for name, picture in pictures.items()}


print("PyAV", av.__version__, "OpenCV", cv2.__version__)
for codec in LOSSLESS:
    print(codec)
    write(codec)
    for name, became in read().items():
        changed = int((became != CLASSES).sum())
        print(f"  {name}: {changed} of 256 changed; 1 became {became[1]}, 20 became {became[20]}")
        if codec == "libx264":
            assert not became[:17].any() and (became[235:] == 255).all() and changed > 230
        else:
            assert changed == 0
print("libx264, color_range 2")
write("libx264", full_range=True)
assert all(np.array_equal(became, CLASSES) for became in read().values())
PYTHON
