"""Calibrations and transforms, read by the layouts of their names whatever the schemas' texts."""

import re
import struct
from typing import Any

import flatbuffers
import numpy as np
import pytest
from foxglove_schemas_flatbuffer import CameraCalibration, FrameTransform, Quaternion, Vector3

from benchmarks.long_logs import MESSAGES
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pictures import decoder_for
from tests.logs.messages.test_decoders import channel, schema

D, K = [-0.1, 0.01, 0.0, 0.0, 0.5], [80.0, 0, 48, 0, 81, 36, 0, 0, 1]
P = [70.0, 0, 47, 0, 0, 71, 35, 0, 0, 0, 1, 0]
STAMP: list[Any] = [5, 7]
INFO = [*STAMP, "cam", 72, 96, "plumb_bob", 5, *D, *K, *K, *P, 2, 3, 1, 2, 30, 40, True]
TRANSFORM = [1, *STAMP, "base_link", "cam", 1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8]
TEXT = MESSAGES["sensor_msgs/msg/CameraInfo"]
UPPER = re.sub(r"(?<=\] )[dkrp]$", lambda name: name[0].upper(), TEXT, flags=re.MULTILINE)
"""The text with D, K, R and P, as rosbags-convert 0.11.9 writes it."""


def packed(values: list[Any], kind: int = 1, *, ros1: bool = False) -> bytes:
    """Return the bytes of a message; ``kind`` is the encapsulation's number."""
    order, widest = "<" if kind & 1 else ">", 4 if kind >= 6 else 8
    data = b""

    def add(code: str, value: Any) -> None:
        nonlocal data
        width = struct.calcsize(code)
        data += b"" if ros1 else bytes(-len(data) % min(width, widest))
        data += struct.pack(order + code, value)

    for value in values:
        if isinstance(value, str):
            text = value.encode() + (b"" if ros1 else b"\0")
            add("I", len(text))
            data += text
        else:
            add({bool: "?", int: "I", float: "d"}[type(value)], value)
    head = b"" if ros1 else bytes([0, kind, 0, 0])
    return head + (struct.pack("<I", len(data)) if kind == 9 else b"") + data


def numbers(values: list[Any]) -> list[Any]:
    """Return all of a message's own numbers as floats where they are so in a message."""
    lens = values.index("plumb_bob") + 2
    return [*values[:lens], *map(float, values[lens : lens + 35]), *values[lens + 35 :]]


def fields(encoding: str, name: str, text: tuple[str, str], data: bytes) -> Any:
    return decoder_for(channel(encoding), schema(name, *text)).fields(data)


@pytest.mark.parametrize("text", [("ros2msg", UPPER), ("", ""), ("omgidl", "module x {}")])
@pytest.mark.parametrize("kind", [0, 1, 7, 9])
def test_a_camera_info_is_read_whatever_its_schema_says(text: tuple[str, str], kind: int):
    """rosbags-convert 0.11.9 writes D, K, R and P, names that mcap-ros2-support 0.5.5 refuses."""
    message = fields("cdr", "sensor_msgs/msg/CameraInfo", text, packed(numbers(INFO), kind))
    assert (message.header.frame_id, message.width, message.height) == ("cam", 96, 72)
    assert (message.distortion_model, message.d, message.k, message.p) == ("plumb_bob", D, K, P)
    assert (message.binning_x, message.binning_y) == (2, 3)
    assert (message.roi.x_offset, message.roi.y_offset) == (1, 2)
    assert (message.roi.width, message.roi.height) == (40, 30)


def test_a_camera_info_of_ros_1_is_read_without_a_text():
    data = packed([1, *numbers(INFO)], ros1=True)
    message = fields("ros1", "sensor_msgs/CameraInfo", ("", ""), data)
    assert (message.width, message.d, message.k, message.binning_y) == (96, D, K, 3)


@pytest.mark.parametrize("kind", [0, 1, 7])
def test_transforms_are_read_without_a_text(kind: int):
    message = fields("cdr", "tf2_msgs/msg/TFMessage", ("", ""), packed(TRANSFORM, kind))
    (frame,) = message.transforms
    assert (frame.header.frame_id, frame.child_frame_id) == ("base_link", "cam")
    assert (frame.transform.translation.z, frame.transform.rotation.w) == (3.0, 0.8)


@pytest.mark.parametrize("cut", [-9, -1, 9])
def test_a_camera_info_of_another_length_is_refused(cut: int):
    data = packed(numbers(INFO))
    data = data[:cut] if cut < 0 else data + bytes(cut)
    with pytest.raises(BadMessage):
        fields("cdr", "sensor_msgs/msg/CameraInfo", ("", ""), data)


def test_a_number_of_transforms_that_cannot_be_is_refused_at_once():
    with pytest.raises(BadMessage):
        fields("cdr", "tf2_msgs/msg/TFMessage", ("", ""), packed([2**32 - 1, *TRANSFORM[1:]]))


def made(builder: flatbuffers.Builder, table: Any, **parts: Any) -> int:
    """Write a table of FlatBuffers."""
    table.Start(builder)
    for name, value in parts.items():
        getattr(table, f"Add{name}")(builder, value)
    return table.End(builder)


def test_foxgloves_flatbuffers_are_read():
    builder = flatbuffers.Builder()
    numbers = zip("DKP", (D, K, P), strict=True)
    parts = {name: builder.CreateNumpyVector(np.array(values)) for name, values in numbers}
    parts |= {"DistortionModel": builder.CreateString("plumb_bob")}
    parts |= {"FrameId": builder.CreateString("cam"), "Width": 96}
    builder.Finish(made(builder, CameraCalibration, **parts))
    text = "flatbuffer", ""
    message = fields("flatbuffer", "foxglove.CameraCalibration", text, bytes(builder.Output()))
    assert (message.frame_id, message.width, message.d, message.k, message.p) == (
        "cam",
        96,
        D,
        K,
        P,
    )

    builder = flatbuffers.Builder()
    parent = builder.CreateString("base_link")
    at, turn = made(builder, Vector3, Z=3.0), made(builder, Quaternion, W=0.8)
    parts = {"ParentFrameId": parent, "Translation": at, "Rotation": turn}
    builder.Finish(made(builder, FrameTransform, **parts))
    message = fields("flatbuffer", "foxglove.FrameTransform", text, bytes(builder.Output()))
    assert (message.parent_frame_id, message.translation.z, message.rotation.w) == (
        "base_link",
        3.0,
        0.8,
    )
