#!/usr/bin/env bash
# PyAV writes the colour tags that it is given into a video, and converts the pictures by others.
#
# Software: PyAV 18.1.0 (with the FFmpeg, libx264, libx265 and libvpx in its wheels), OpenCV 5.0.0.
#
# `colorspace` and `color_range` of a stream's codec context say how the colours of a video are to be
# read, and both are in the file afterwards. Pictures go in as RGB, which `encode` makes YUV. It does
# this by BT.601 and the narrow range whatever the stream says, and the tags then tell every reader to
# undo something else. Without tags a flat (200, 60, 30) comes back within 1. As BT.709 it comes back
# as (214, 72, 27), as BT.709 with the full range as (202, 77, 38), as BT.601 with the full range as
# (191, 67, 41), by PyAV and by OpenCV alike, and in H.264, H.265, VP9 and FFV1. So a log that is
# written as its specification asks (BT.709 for HD) has shifted colours, and one that forgets the tags
# has not. Pictures that the caller converts first, by `reformat` with `dst_colorspace` and
# `dst_color_range` of the same values, come back within 1.
#
# Source: the pixels of each. `VideoCodecContext` in av/video/codeccontext.py hands the frame to its
# reformatter with the size and the pixel format alone.
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
from av.video.reformatter import ColorRange, Colorspace

COLOUR = np.array([200, 60, 30])
LOSSLESS = {
    "libx264": {"qp": "0"},
    "libx265": {"x265-params": "lossless=1:log-level=none"},
    "libvpx-vp9": {"lossless": "1"},
    "ffv1": {},
}
BT709, BT601 = Colorspace.ITU709, Colorspace.ITU601
NARROW, FULL = ColorRange.MPEG, ColorRange.JPEG


def write(codec, space, colour_range, converted):
    with av.open("flat.mkv", "w") as container:
        stream = container.add_stream(codec, rate=10, options=LOSSLESS[codec])
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv444p"
        if space is not None:
            stream.codec_context.colorspace = space
            stream.codec_context.color_range = colour_range
        for number in range(3):
            picture = np.full((48, 64, 3), COLOUR, np.uint8)
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            if converted:
                frame = frame.reformat(
                    format="yuv444p", dst_colorspace=space, dst_color_range=colour_range
                )
            frame.pts = number
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def read():
    """Return the tags, and the colour by PyAV and by OpenCV."""
    with av.open("flat.mkv") as container:
        frame = next(container.decode(video=0))
    ok, picture = cv2.VideoCapture("flat.mkv").read()
    assert ok
    colours = frame.to_ndarray(format="rgb24")[20, 20], picture[20, 20, ::-1]
    return (int(frame.colorspace), int(frame.color_range)), [c.tolist() for c in colours]


def error(colours):
    return int(np.abs(np.array(colours) - COLOUR).max())


print("PyAV", av.__version__, "OpenCV", cv2.__version__)
WRONG = {
    ("BT.709", BT709, NARROW): [214, 72, 27],
    ("BT.709, full range", BT709, FULL): [202, 77, 38],
    ("BT.601, full range", BT601, FULL): [191, 67, 41],
}
for codec in LOSSLESS:
    write(codec, None, None, converted=False)
    _, colours = read()
    print(f"{codec}: no tags: {colours}")
    assert error(colours) <= 1
    for (name, space, colour_range), wrong in WRONG.items():
        write(codec, space, colour_range, converted=False)
        tags, colours = read()
        write(codec, space, colour_range, converted=True)
        same_tags, by_caller = read()
        print(f"{codec}: {name}: {colours}; converted by the caller: {by_caller}")
        assert tags == same_tags == (int(space), int(colour_range))
        assert colours == [wrong, wrong]
        assert error(by_caller) <= 1
PYTHON
