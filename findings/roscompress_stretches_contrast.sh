#!/usr/bin/env bash
# pymcap-cli's video of JPEG images comes back with stretched contrast, that of raw images does not.
#
# Software: pymcap-cli 0.34.0 with its extra `video`, which uses PyAV 18.1.0; mcap-ros2-support 0.6.0,
# OpenCV 5.0.0.
#
# `pymcap-cli roscompress` makes a CompressedVideo of an image topic. The values of a JPEG are YCbCr of
# the full range, 0 to 255. The tool encodes them as they are, and the video does not say that its
# range is full, so that it is read as 16 to 235: a grey of 31 becomes 17, one of 223 becomes 241, and
# what was darker than 16 or brighter than 235 is black or white. The same pictures as
# sensor_msgs/msg/Image, in the same run of the tool, come back within 3. So two cameras of one log
# differ in contrast after the compression, and a network or a threshold that was fitted before gives
# other results, which looks like a loss by compression; no quality setting helps. H.264 and H.265 are
# alike in this. A reader that is told that the range is full, as by `src_color_range` of PyAV's
# `to_ndarray`, gets the pictures as they were.
#
# Source: the pixels of both; the frames' format is yuv420p, and their `color_range` is 0 (H.264: not
# stated) or 1 (H.265: 16 to 235).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  "pymcap-cli[video,pointcloud]==0.34.0" av==18.1.0 mcap==1.6.0 mcap-ros2-support==0.6.0 \
  opencv-python-headless==5.0.0.93 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import av
import cv2
import numpy as np
from av.video.reformatter import ColorRange
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer

LINE = "=" * 80
HEADER = f"""{LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{LINE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
COMPRESSED = f"std_msgs/Header header\nstring format\nuint8[] data\n{HEADER}"
RAW = f"""std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
{HEADER}"""
WIDTH, HEIGHT, COUNT = 320, 240, 10
ramp = np.linspace(0, 255, WIDTH).astype(np.uint8)
picture = np.repeat(np.tile(ramp, (HEIGHT, 1))[..., None], 3, axis=2)


def write(path):
    with open(path, "wb") as file:
        writer = Writer(file)
        raw = writer.register_msgdef("sensor_msgs/msg/Image", RAW)
        compressed = writer.register_msgdef("sensor_msgs/msg/CompressedImage", COMPRESSED)
        jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()
        size = {"height": HEIGHT, "width": WIDTH, "step": 3 * WIDTH, "is_bigendian": 0}
        for number in range(COUNT):
            header = {"stamp": {"sec": number, "nanosec": 0}, "frame_id": "camera"}
            when = {"log_time": number * 10**9, "publish_time": number * 10**9}
            pixels = {**size, "encoding": "bgr8", "data": picture.tobytes()}
            writer.write_message("/raw", raw, {"header": header, **pixels}, **when)
            message = {"header": header, "format": "jpeg", "data": jpeg}
            writer.write_message("/jpeg", compressed, message, **when)
        writer.finish()


def read(path, codec):
    """Return by topic the first frame of the video."""
    packets = {}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, _, message in reader.iter_decoded_messages():
            assert schema.name.endswith("CompressedVideo")
            packets.setdefault(channel.topic, []).append(bytes(message.data))
    frames = {}
    for topic, all_data in packets.items():
        decoder = av.CodecContext.create(codec, "r")
        decoded = [frame for data in all_data for frame in decoder.decode(av.Packet(data))]
        frames[topic] = (decoded + decoder.decode(None))[0]
    return frames


def greys(frame, **options):
    return np.median(frame.to_ndarray(format="rgb24", **options)[..., 1], axis=0).astype(int)


print(*(f"{name} {version(name)}" for name in ("pymcap-cli", "av")))
write("log.mcap")
tool = Path(sys.executable).with_name("pymcap-cli")
for codec, encoder in (("h264", "libx264"), ("h265", "libx265")):
    made = f"{codec}.mcap"
    options = ["--codec", codec, "--encoder", encoder, "--quality", "10", "-o", made]
    subprocess.run([tool, "roscompress", "log.mcap", *options], check=True, capture_output=True)
    frames = read(made, {"h264": "h264", "h265": "hevc"}[codec])
    (by_raw,), (by_jpeg,) = ([f for t, f in frames.items() if n in t] for n in ("raw", "jpeg"))
    full = greys(by_jpeg, src_color_range=ColorRange.JPEG)
    for name, found in {"raw": greys(by_raw), "JPEG": greys(by_jpeg), "as full range": full}.items():
        told = ", ".join(f"{ramp[column]} is {found[column]}" for column in (12, 39, 200, 280, 305))
        print(f"{codec}, {name}: {told}")
    state = by_jpeg.format.name, int(by_jpeg.color_range)
    print(f"{codec}: {state[0]}, color_range {state[1]}")
    assert np.abs(greys(by_raw) - ramp).max() <= 3
    assert np.abs(full - ramp).max() <= 3
    stretched = np.clip((ramp.astype(float) - 16) * 255 / 219, 0, 255)
    assert np.abs(greys(by_jpeg) - stretched).max() <= 4
    assert state[0] == "yuv420p" and state[1] != int(ColorRange.JPEG)
PYTHON
