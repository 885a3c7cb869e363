#!/usr/bin/env bash
# Images whose rows end in padding come out slanted from rosbags-image, and NV12 ones so from Rerun.
#
# Software: rosbags-image 0.10.4 with rosbags 0.11.9; rerun-sdk 0.41.0 with mcap-ros2-support 0.6.0.
#
# `step` of a sensor_msgs/msg/Image is the length of a row in bytes, and may be more than the pixels
# of it need: drivers that take pictures from a graphics card or a frame grabber end each row at a
# multiple of 16, 64 or 256. `message_to_cvimage`, which its page presents as what cv_bridge does,
# never reads `step`. It takes the first height * width pixels of the data, so that every row begins
# some bytes later than the one above, the padding stands as stripes in the picture, and the lowest
# rows are missing. Shape and type are right, and nothing is raised. A width that needs no padding,
# such as 640, shows nothing of it.
#
# `rerun mcap convert` takes the padding off rgb8 and mono8. Of NV12, whose rows have one byte for a
# pixel, it keeps width * 3 / 2 bytes of each, as if they had twelve bits, and the rest slips.
#
# Source: the pixels of both. The definition of sensor_msgs/msg/Image: "step: Full row length in bytes"
# and "data: actual matrix data, size is (step * rows)". rosbags/image/image.py has no word of `step`
# where it reads.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  rosbags-image==0.10.4 rosbags==0.11.9 opencv-python-headless==5.0.0.93 rerun-sdk==0.41.0 \
  mcap==1.6.0 mcap-ros2-support==0.6.0
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
from mcap_ros2.writer import Writer
from rosbags.image import message_to_cvimage
from rosbags.typesys import Stores, get_typestore

LINE = "=" * 80
DEFINITION = f"""std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
{LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{LINE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
HEIGHT, WIDTH, STEP = 4, 8, 16
PADDING = 255
types = get_typestore(Stores.ROS2_JAZZY).types


def padded(rows):
    data = np.full((len(rows), STEP), PADDING, np.uint8)
    data[:, :WIDTH] = rows
    return data


def by_rosbags_image(data):
    stamp = types["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
    message = types["sensor_msgs/msg/Image"](
        header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera"),
        height=HEIGHT,
        width=WIDTH,
        encoding="mono8",
        is_bigendian=0,
        step=data.shape[1],
        data=data.reshape(-1),
    )
    return message_to_cvimage(message)


def by_rerun(data, encoding):
    """Return the first bytes of the picture, as many as `rerun rrd print` prints."""
    rerun = Path(sys.executable).with_name("rerun")
    with open("log.mcap", "wb") as file:
        writer = Writer(file)
        schema = writer.register_msgdef("sensor_msgs/msg/Image", DEFINITION)
        message = {
            "header": {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": "camera"},
            "height": HEIGHT,
            "width": WIDTH,
            "encoding": encoding,
            "is_bigendian": 0,
            "step": data.shape[1],
            "data": data.tobytes(),
        }
        writer.write_message("/camera", schema, message, log_time=10**9, publish_time=10**9)
        writer.finish()
    convert = [rerun, "mcap", "convert", "log.mcap", "-o", "log.rrd"]
    subprocess.run(convert, check=True, capture_output=True)
    told = subprocess.run([rerun, "rrd", "print", "-vvv", "log.rrd"], check=True, capture_output=True)
    (numbers,) = set(re.findall(r"\[\[(0, (?:\d+, ){20,})", told.stdout.decode()))
    return [int(number) for number in numbers.split(", ")[:-1]]


print(*(f"{name} {version(name)}" for name in ("rosbags-image", "rosbags", "rerun-sdk")))
grey = np.arange(HEIGHT * WIDTH, dtype=np.uint8).reshape(HEIGHT, WIDTH)
assert np.array_equal(by_rosbags_image(grey), grey)
slanted = by_rosbags_image(padded(grey))
print(f"rosbags-image, rows of {WIDTH} pixels in {STEP} bytes:", slanted, sep="\n")
assert slanted.shape == grey.shape and slanted.dtype == grey.dtype
assert np.array_equal(slanted.reshape(-1), padded(grey).reshape(-1)[: grey.size])

nv12 = np.concatenate([grey, np.full((HEIGHT // 2, WIDTH), 128, np.uint8)])
plain, encoded = by_rerun(nv12, "nv12"), by_rerun(padded(nv12), "nv12")
taken = padded(nv12)[:, : WIDTH * 3 // 2].reshape(-1)
print("Rerun, nv12 without padding:", plain)
print("Rerun, nv12 with padding:   ", encoded)
assert plain == nv12.reshape(-1)[: len(plain)].tolist()
assert encoded == taken[: len(encoded)].tolist() and PADDING in encoded
mono = by_rerun(padded(grey), "mono8")
print("Rerun, mono8 with padding:  ", mono)
assert mono == grey.reshape(-1)[: len(mono)].tolist()
PYTHON
