#!/usr/bin/env bash
# rosbags-image gives 8 bits for a compressed 16-bit picture: 1000 mm raw is 3 when compressed.
#
# Software: rosbags-image 0.10.4 with rosbags 0.11.9, opencv-python-headless 4.14.0.94, numpy 2.4.6.
#
# ROS's `compressed` transport writes pictures of 16 bits (mono16 of thermal cameras, 16UC1 of depth
# cameras, raw Bayer patterns) as PNG with 16 bits, without loss. `message_to_cvimage` reads a raw
# message of them as uint16, and the compressed message of the same picture as uint8: the upper byte
# alone, so that all depths below 256 mm are 0, and 1000 and 1023 mm are the same. Neither the text
# `16UC1; png compressed ` of its format is read, nor is anything raised. A mask by a threshold in
# millimetres finds nothing, and a rate of it against truth looks like one of a bad method. Asking
# for "mono16" or "16UC1" ends with an error, so only the call without a colour space works, wrongly.
# The other way, 8 bits asked for as "mono16", are an array of float64, not of uint16.
#
# Source: rosbags/image/image.py decodes with IMREAD_ANYCOLOR, without IMREAD_ANYDEPTH; its page
# promises the functionality of cv_bridge, which decodes PNG unchanged in ROS 2.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  rosbags-image==0.10.4 rosbags==0.11.9 opencv-python-headless==4.14.0.94 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import cv2
import numpy as np
from rosbags.image import message_to_cvimage
from rosbags.typesys import Stores, get_typestore

types = get_typestore(Stores.ROS2_JAZZY).types
stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="depth_camera")


def raw(pixels, encoding):
    """Return a sensor_msgs/msg/Image."""
    height, width = pixels.shape
    return types["sensor_msgs/msg/Image"](
        header=header, height=height, width=width, encoding=encoding, is_bigendian=0,
        step=pixels.strides[0], data=np.frombuffer(pixels.tobytes(), np.uint8),
    )


depths = np.array([[100, 255, 256, 1000, 1023, 2560, 65535]], np.uint16)
png = cv2.imencode(".png", depths)[1].ravel()
assert np.array_equal(cv2.imdecode(png, cv2.IMREAD_UNCHANGED), depths), "the PNG has all 16 bits"
compressed = types["sensor_msgs/msg/CompressedImage"](
    header=header, format="16UC1; png compressed ", data=png
)
by_raw, by_png = message_to_cvimage(raw(depths, "16UC1")), message_to_cvimage(compressed)
for name, pixels in {"raw": by_raw, "compressed": by_png}.items():
    print(f"{name:10} {pixels.dtype}", *pixels[0].tolist())
assert np.array_equal(by_raw, depths)
assert by_png.dtype == np.uint8
assert np.array_equal(by_png, depths >> 8)
for asked in ("16UC1", "mono16"):
    try:
        message_to_cvimage(compressed, asked)
    except Exception as error:
        print(f"as {asked}: {type(error).__name__}")
    else:
        raise AssertionError("it is converted")

widened = message_to_cvimage(raw(np.array([[0, 1, 255]], np.uint8), "mono8"), "mono16")
print("8 bits as mono16:", widened.dtype, *widened[0].tolist())
assert widened.dtype == np.float64
PYTHON
