#!/usr/bin/env bash
# Rerun shows a grey camera image of a ROS 2 log as depth, and the same of a Foxglove log as a picture.
#
# Software: rerun-sdk 0.41.0, with logs by mcap-ros2-support and mcap-protobuf-support.
#
# Two logs hold the same 8x6 pixels with the encoding `mono8`: one as sensor_msgs/msg/Image, one as
# foxglove.RawImage. `rerun mcap convert` makes a `DepthImage` of the first and an `Image` of the
# second. A viewer shows a DepthImage in false colours and, with a pinhole, as points in space, so a
# grey camera, or a mask of labels, of a ROS 2 log looks like a lidar's picture.
#
# Source: what `rerun rrd print` says of the converted files.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check rerun-sdk==0.41.0 mcap==1.6.0 \
  mcap-ros2-support==0.6.0 mcap-protobuf-support==0.6.0 foxglove-schemas-protobuf==0.4.0
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.timestamp_pb2 import Timestamp
from mcap_protobuf.writer import Writer as FoxgloveWriter
from mcap_ros2.writer import Writer as RosWriter

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
WHEN = {"log_time": 10**9, "publish_time": 10**9}
IMAGE = {"height": 6, "width": 8, "encoding": "mono8", "step": 8, "data": bytes(range(48))}
folder = Path(sys.argv[1])

with open(folder / "ros2.mcap", "wb") as file:
    writer = RosWriter(file)
    schema = writer.register_msgdef("sensor_msgs/msg/Image", DEFINITION)
    header = {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": "camera"}
    message = {**IMAGE, "header": header, "is_bigendian": 0}
    writer.write_message(topic="/camera", schema=schema, message=message, **WHEN)
    writer.finish()
with open(folder / "foxglove.mcap", "wb") as file, FoxgloveWriter(file) as writer:
    message = RawImage(timestamp=Timestamp(seconds=1), frame_id="camera", **IMAGE)
    writer.write_message(topic="/camera", message=message, **WHEN)

print("rerun-sdk", version("rerun-sdk"))
rerun = Path(sys.executable).with_name("rerun")
for name, expected in (("ros2", "DepthImage"), ("foxglove", "Image")):
    made = folder / f"{name}.rrd"
    convert = [rerun, "mcap", "convert", folder / f"{name}.mcap", "-o", made]
    subprocess.run(convert, check=True, capture_output=True)
    told = subprocess.run([rerun, "rrd", "print", "-vv", made], check=True, capture_output=True)
    found = set(re.findall(r"(\w*Image):buffer", told.stdout.decode()))
    print(f"{name}: {', '.join(sorted(found))}")
    assert found == {expected}
PYTHON
