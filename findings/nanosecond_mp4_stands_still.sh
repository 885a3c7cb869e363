#!/usr/bin/env bash
# In an MP4 that is written with nanoseconds, time stands still after a gap of 2.15 seconds.
#
# Software: PyAV 18.1.0 (with the FFmpeg, libx264 and libx265 in its wheels), OpenCV 5.0.0.
#
# The pictures of a log are made a video with their own stamps, and as ROS, MCAP and most cameras count
# nanoseconds, the time base is 1 / 10**9. MP4 can hold that: pictures at 10 Hz come back to the
# nanosecond, in a file of hours as well. After two pictures that lie 2**31 ns apart or more (a camera
# that paused, a topic that was cut, a drive that was joined of two, one picture every three seconds)
# every later picture, to the end of the file, is one nanosecond after the one before. All pictures are
# there, none is corrupt, nothing is raised, and OpenCV reads the same times: a label or a pose that is
# looked up by time is that of the moment of the gap. FFmpeg gives a warning for each of these
# packets, but PyAV hides warnings by default (its log level is None). MOV and fragmented MP4 are alike.
# This holds for videos without B-frames, as logs have them; with B-frames muxing raises an error.
#
# Microseconds, as the time base of the stream's codec context or by the container's option
# `video_track_timescale`, keep the times for gaps up to 35 minutes.
#
# Source: the times of the pictures; the warning, with `av.logging.set_level(av.logging.WARNING)`:
# "Packet duration: 6100000000 / dts: 6500000000 in stream 0 is out of range". libavformat/movenc.c
# then puts the packet one tick behind the one before, and measures the next one from there.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  av==18.1.0 opencv-python-headless==5.0.0.93 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
from fractions import Fraction

import av
import cv2
import numpy as np

COUNT, BEFORE = 10, 5  # pictures, and those before the gap
NANO, MICRO = Fraction(1, 10**9), Fraction(1, 10**6)
NO_B_FRAMES = {"libx264": {"bf": "0"}, "libx265": {"x265-params": "bframes=0:log-level=none"}}


def stamps_of(gap):
    """Return nanoseconds: pictures at 10 Hz, and ``gap`` between two of them."""
    return [100_000_000 * n + (gap - 100_000_000) * (n >= BEFORE) for n in range(COUNT)]


def times(stamps, codec="libx264", path="drive.mp4", base=NANO, options=None):
    """Return the nanoseconds that PyAV, and the milliseconds that OpenCV, read of a new video."""
    with av.open(path, "w", options=options or {}) as container:
        stream = container.add_stream(codec, rate=10, options=NO_B_FRAMES[codec])
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.codec_context.time_base = base
        for number, stamp in enumerate(stamps):
            picture = np.full((48, 64, 3), 8 * number, np.uint8)
            frame = av.VideoFrame.from_ndarray(picture)
            frame.pts, frame.time_base = int(stamp * NANO / base), base
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    with av.open(path) as container:
        frames = list(container.decode(video=0))
    assert [round(f.to_ndarray(format="gray").mean() / 8) for f in frames] == list(range(COUNT))
    assert not any(frame.is_corrupt for frame in frames)
    capture, by_opencv = cv2.VideoCapture(path), []
    while capture.read()[0]:
        by_opencv.append(round(capture.get(cv2.CAP_PROP_POS_MSEC)))
    return [int(frame.pts * frame.time_base / NANO) for frame in frames], by_opencv


print("PyAV", av.__version__, "OpenCV", cv2.__version__, "log level", av.logging.get_level())
assert av.logging.get_level() is None
for gap in (100_000_000, 2**31 - 2, 2**31, 6_000_000_000):
    stamps = stamps_of(gap)
    by_pyav, by_opencv = times(stamps)
    print(f"gap of {gap} ns, the last times: {by_pyav[BEFORE - 1 :]} ns")
    if gap < 2**31:
        assert by_pyav == stamps
    else:
        last = stamps[BEFORE - 1]
        assert by_pyav == stamps[:BEFORE] + [last + n for n in range(1, COUNT - BEFORE + 1)]
        assert set(by_opencv[BEFORE:]) == {by_opencv[BEFORE - 1]}
every_three_seconds, _ = times([3 * 10**9 * n for n in range(COUNT)])
print(f"a picture every 3 s: {every_three_seconds} ns")
assert every_three_seconds == list(range(COUNT))

FRAGMENTED = {"movflags": "frag_keyframe+empty_moov"}
for name, options in {
    "H.265": {"codec": "libx265"},
    "MOV": {"path": "drive.mov"},
    "fragmented": {"options": FRAGMENTED},
}.items():
    by_pyav, _ = times(stamps, **options)
    print(f"{name}: {by_pyav[BEFORE - 1 :]} ns")
    assert max(by_pyav) - stamps[BEFORE - 1] <= COUNT
for options in ({"base": MICRO}, {"options": {"video_track_timescale": "1000000"}}):
    assert times(stamps, **options)[0] == stamps
print("microseconds: as they were written")
PYTHON
