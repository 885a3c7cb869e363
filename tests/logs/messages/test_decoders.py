"""Messages in every encoding, to the picture they carry."""

import json
import struct
from typing import Any

import pytest
import zstandard
from mcap.records import Channel, Schema
from mcap_ros2._dynamic import serialize_dynamic

from roadeval.logs.container.records import Message
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pictures import (
    CompressedPicture,
    Picture,
    decoder_for,
    message_stamp,
)
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
