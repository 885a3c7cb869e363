"""Messages in every encoding: pictures and their pixels, calibrations and transforms."""

import json
import re
import struct
from typing import Any

import flatbuffers
import numpy as np
import pytest
import zstandard
from foxglove_schemas_flatbuffer import CameraCalibration, FrameTransform, Quaternion, Vector3
from mcap.records import Channel, Schema
from mcap_ros2._dynamic import serialize_dynamic

from benchmarks.long_logs import MESSAGES
from roadeval.images.formats import Limits
from roadeval.logs.container.records import Message
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pictures import (
    CompressedPicture,
    Picture,
    RawPicture,
    decoder_for,
    message_stamp,
)
from roadeval.logs.messages.pixels import to_labels, to_rgb
from tests.logs.making import COMPRESSED, compressed

STAMP = 1_700_000_000_123_456_789
NAME = "sensor_msgs/msg/CompressedImage"


def channel(encoding: str) -> Channel:
    return Channel(id=1, topic="/cam", message_encoding=encoding, metadata={}, schema_id=1)


def schema(name: str, encoding: str, text: str = "") -> Schema:
    return Schema(id=1, name=name, encoding=encoding, data=text.encode())


def read(encoding: str, described: Schema | None, data: bytes) -> Picture:
    return decoder_for(channel(encoding), described).picture(data)


PACKED = serialize_dynamic(NAME, COMPRESSED)[NAME](compressed(STAMP, b"file"))
BIG_ENDIAN = bytes(4) + struct.pack(
    ">III4sI5sxxxI4s", *divmod(STAMP, 10**9), 4, b"cam\0", 5, b"jpeg\0", 4, b"file"
)


@pytest.mark.parametrize(
    ("described", "data"),
    [
        (schema(NAME, "ros2msg", "uint3 nonsense"), PACKED),
        (schema(NAME, "omgidl", "module ..."), PACKED),
        (schema(NAME, ""), BIG_ENDIAN),
        (schema(NAME, "ros2msg", COMPRESSED), zstandard.compress(PACKED)),
    ],
    ids=["a schema that makes no sense", "omgidl", "big endian", "compressed by rosbag2"],
)
def test_cdr_is_read_as_writers_leave_it(described: Schema, data: bytes) -> None:
    picture = read("cdr", described, data)
    assert isinstance(picture, CompressedPicture)
    assert (picture.stamp_ns, picture.format, bytes(picture.data)) == (STAMP, "jpeg", b"file")


@pytest.mark.parametrize(
    "fields",
    [
        {"timestamp": {"sec": 5, "nsec": 6}},
        {"timestamp": {"seconds": 5, "nanos": 6}},
        {"timestamp": "1970-01-01T00:00:05.000000006Z"},
        {"header": {"stamp": {"sec": 5, "nanosec": 6}, "frame_id": "cam"}},
        {"header": {"stamp": {"secs": 5, "nsecs": 6}, "frame_id": "cam"}},
    ],
)
def test_json_is_read_with_every_form_of_a_stamp(fields: dict[str, Any]) -> None:
    message = fields | {"format": "jpeg", "data": "ZmlsZQ=="}
    picture = read("json", None, json.dumps(message).encode())
    assert isinstance(picture, CompressedPicture)
    decoded = picture.stamp_ns, picture.format, bytes(picture.data)
    assert decoded == (5_000_000_006, "jpeg", b"file")


@pytest.mark.parametrize(
    ("encoding", "described", "data"),
    [
        # A damaged schema may make a number of the format's name.
        ("json", None, b'{"format": null, "data": "ZmlsZQ=="}'),
        ("json", None, b'{"format": 1.5, "data": "ZmlsZQ=="}'),
        ("json", None, b'{"format": ["jpeg"], "data": "ZmlsZQ=="}'),
        ("json", None, b'{"x": 1}'),
        ("json", None, b"{"),
        ("json", None, b'{"format": "jpeg", "data": "?"}'),
        ("json", None, b'{"format": "jpeg", "data": 4000000000}'),
        ("cdr", schema(NAME, ""), b"\x00\x01\x00"),
        ("cdr", schema(NAME, ""), PACKED[:-2]),
        ("flatbuffer", schema("foxglove.CompressedImage", "flatbuffer"), b"\x10\x00\x00\x00abc"),
        ("protobuf", schema("foxglove.CompressedImage", "protobuf", "?"), b""),
        ("cbor", schema("foxglove.CompressedImage", ""), b""),
    ],
)
def test_what_cannot_be_read_is_refused(encoding, described, data):
    with pytest.raises(BadMessage):
        read(encoding, described, data)


@pytest.mark.parametrize(
    ("data", "is_whole"), [(PACKED, True), (PACKED[:-1], False), (PACKED + b"more", False)]
)
def test_a_message_is_as_long_as_its_fields_say(data: bytes, is_whole: bool) -> None:
    message = Message(1, 0, 0, 0, memoryview(data))
    described = schema(NAME, "ros2msg", COMPRESSED)
    assert (message_stamp(channel("cdr"), described, message) is not None) is is_whole


D, K = [-0.1, 0.01, 0.0, 0.0, 0.5], [80.0, 0, 48, 0, 81, 36, 0, 0, 1]
P = [70.0, 0, 47, 0, 0, 71, 35, 0, 0, 0, 1, 0]
TIME: list[Any] = [5, 7]
INFO = [*TIME, "cam", 72, 96, "plumb_bob", 5, *D, *K, *K, *P, 2, 3, 1, 2, 30, 40, True]
TRANSFORM = [1, *TIME, "base_link", "cam", 1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8]
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


LIMITS = Limits()


def picture(data: bytes, encoding: str, width: int, height: int = 1, step: int = 0) -> RawPicture:
    return RawPicture(0, width, height, encoding, step, False, data)


def test_floats_count_from_zero_to_one_and_nan_is_black() -> None:
    data = np.array([0, 0.5, 1, 2, np.nan], np.float32).tobytes()
    pixels = to_rgb(picture(data, "32FC1", 5), LIMITS)
    assert pixels[0, :, 0].tolist() == [0, 128, 255, 255, 0]


def test_labels_keep_sixteen_bits() -> None:
    assert to_labels(picture(b"\x2c\x01", "16UC1", 1), LIMITS).tolist() == [[300]]


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (picture(b"\x01", "mono8", 2), "1 bytes of pixels where 2 are needed"),
        (picture(b"", "mono8", 0), "an image of 0x1"),
        (picture(b"\x01\x02", "mono8", 2, step=1), "with 1 bytes a row"),
        (picture(b"\x01", "mono8", 2**31, 2**31), "an image of"),
        (picture(b"\x01", "h8s2", 1), "encoding 'h8s2' is unknown"),
    ],
)
def test_what_cannot_be_is_refused(bad: RawPicture, reason: str) -> None:
    with pytest.raises(BadMessage, match=reason):
        to_rgb(bad, LIMITS)
