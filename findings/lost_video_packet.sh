#!/usr/bin/env bash
# A packet that is missing from a video is not an error, and marks no picture as corrupt.
#
# Software: PyAV 18.1.0 (with the FFmpeg, libx264, libx265 and libvpx in its wheels).
#
# A video of 30 pictures has one key frame, the first, and packet 10 is taken away, as where a
# recorder dropped a message. What happens depends on the codec:
#
# - H.264 and VP9 give 29 pictures. Nothing is raised, and `is_corrupt` is False on all of them. From
#   the gap on to the end every picture is wrong, by 10 or more of 255 on average.
# - H.265 gives the 10 pictures before the gap and none after it, and nothing is raised either.
#
# So neither an exception nor a flag tells a reader of a log that pictures are wrong or absent: the
# packets' own numbers have to.
#
# Source: `Frame.is_corrupt` in PyAV's av/frame.py, which asks FFmpeg for `decode_error_flags` and
# `AV_FRAME_FLAG_CORRUPT`; both stay 0 where a reference is missing.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check av==18.1.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
from fractions import Fraction

import av
import numpy as np

LOST, PICTURES = 10, 30
FAST = {"preset": "ultrafast", "tune": "zerolatency"}
ENCODERS = {
    "h264": ("libx264", FAST),
    "hevc": ("libx265", FAST | {"x265-params": "log-level=none"}),
    "vp9": ("libvpx-vp9", {"lag-in-frames": "0", "deadline": "realtime"}),
}


def packets(encoder, options):
    context = av.CodecContext.create(encoder, "w")
    context.width, context.height, context.pix_fmt = 160, 120, "yuv420p"
    context.time_base, context.gop_size, context.max_b_frames = Fraction(1, 30), 100, 0
    context.options = options
    blocks = np.random.default_rng(0).integers(0, 256, (15, 20, 3), np.uint8)
    picture = blocks.repeat(8, axis=0).repeat(8, axis=1)
    made = []
    for number in range(PICTURES):
        frame = av.VideoFrame.from_ndarray(np.roll(picture, 3 * number, axis=1), "rgb24")
        frame.pts = number
        made += context.encode(frame)
    return [bytes(packet) for packet in [*made, *context.encode(None)]]


def pictures(codec, data):
    context, frames = av.CodecContext.create(codec, "r"), []
    for packet in (*map(av.Packet, data), None):
        frames += context.decode(packet)  # an exception would end this script
    return frames, [frame.to_ndarray(format="rgb24").astype(int) for frame in frames]


print("PyAV", av.__version__)
for codec, (encoder, options) in ENCODERS.items():
    whole = packets(encoder, options)
    assert len(whole) == PICTURES
    _, intact = pictures(codec, whole)
    frames, found = pictures(codec, whole[:LOST] + whole[LOST + 1 :])
    later = zip(intact[LOST + 1 :], found[LOST:])
    errors = [float(abs(one - other).mean()) for one, other in later]
    corrupt = sum(frame.is_corrupt for frame in frames)
    print(f"{codec}: {len(found)} pictures, {corrupt} marked as corrupt, off by", end=" ")
    print(f"{min(errors):.1f} or more after the gap" if errors else "nothing: none after the gap")
    assert len(intact) == PICTURES
    assert corrupt == 0
    assert len(found) == (LOST if codec == "hevc" else PICTURES - 1)
    assert all(error > 10 for error in errors)
PYTHON
