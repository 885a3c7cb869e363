#!/usr/bin/env bash
# One packet without data among those of a video ends PyAV's decoder: the frame behind it is an EOFError.
#
# Software: PyAV 18.1.0 (with the FFmpeg, libx264, libx265 and libvpx in its wheel), with numpy 2.4.6.
#
# A camera or a bridge that leaves out a picture may send its message with no data: the log has a
# packet of 0 bytes between good ones. `decoder.decode(av.Packet(b""))` raises nothing and returns
# the frames that the decoder still holds, as `decode(None)` does at the end of a video. From then on the
# decoder is at its end: the next packet raises EOFError ("End of file"), and so does each one after it. A
# program that takes this for the end of the log stops there, with a plausible video of the first
# part; one that skips packets with errors loses all that follow, although none of them is damaged.
#
# Leave out packets without data, or call `decoder.flush_buffers()` and go on at the next keyframe.
#
# Source: FFmpeg's documentation of `avcodec_send_packet` says that a packet with data NULL or size 0
# is a flush packet, which signals the end of the stream, and that of the codec context that decoding
# goes on after `avcodec_flush_buffers`. PyAV's documentation of `CodecContext.decode` names None alone.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check av==18.1.0 numpy==2.4.6
"$folder/venv/bin/python" - 2> /dev/null <<'PYTHON'
from fractions import Fraction

import av
import numpy as np


def packets_of(encoder):
    """Return the packets of 30 pictures, each brighter than the one before; all build on the first."""
    context = av.CodecContext.create(encoder, "w")
    context.width, context.height, context.pix_fmt = 64, 48, "yuv420p"
    context.time_base = Fraction(1, 10)
    context.max_b_frames = 0
    context.options = {"x265-params": "log-level=none:bframes=0"} if encoder == "libx265" else {}
    packets = []
    for number in range(30):
        picture = np.full((48, 64, 3), 8 * number, np.uint8)
        frame = av.VideoFrame.from_ndarray(picture, "rgb24")
        frame.pts = number
        packets += context.encode(frame)
    packets += context.encode(None)
    return [bytes(packet) for packet in packets]


def decoded(codec, packets, *, flush):
    """Return how many frames come out, and the errors on the way."""
    decoder, frames, errors = av.CodecContext.create(codec, "r"), [], []
    decoder.thread_count = 1
    for data in [*packets, None]:
        try:
            frames += decoder.decode(None if data is None else av.Packet(data))
            if flush and data == b"":
                decoder.flush_buffers()
        except av.EOFError as error:
            errors.append(error)
    return len(frames), len(errors)


print("PyAV", av.__version__)
for encoder, codec in (("libx264", "h264"), ("libx265", "hevc"), ("libvpx-vp9", "vp9")):
    packets = packets_of(encoder)
    assert len(packets) == 30
    with_empty = [*packets[:10], b"", *packets[10:]]
    whole, broken = (decoded(codec, some, flush=False) for some in (packets, with_empty))
    two = [*packets, b"", *packets]
    flushed = decoded(codec, two, flush=True)
    print(f"{codec}: {whole[0]} frames; with an empty packet behind ten {broken[0]}, {broken[1]} errors")
    print(f"  the video twice, an empty packet between, flush_buffers after it: {flushed[0]} frames")
    assert whole == (30, 0)
    assert broken == (10, 21), broken
    assert flushed == (60, 0), flushed
PYTHON
