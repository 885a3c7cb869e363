"""The message encodings that logs are written in."""

from __future__ import annotations

import base64
import json
from functools import partial
from importlib import import_module
from types import SimpleNamespace
from typing import Any, Final

from mcap.records import Schema

from roadeval.logs.container.records import LARGEST, PADDING, Buffer
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.encoding import (
    NESTED,
    Encoding,
    FieldReader,
    Fields,
    Layouts,
    MessageReader,
    TopicKind,
    decode_by_library,
    fields_of,
    parts_of,
)

_ZSTD: Final = b"\x28\xb5\x2f\xfd"


def cdr(schema: Schema | None) -> MessageReader | None:
    """Return a reader of CDR, the encoding of ROS 2: either byte order, and XCDR2.

    Messages that rosbag2 has compressed are read as well.
    """
    from mcap_ros2.decoder import DecoderFactory

    decode = decode_by_library(DecoderFactory(), "cdr", schema)
    fields = fields_of(schema)
    if fields is None:
        return decode and MessageReader(lambda data: decode(_uncompressed(data)))
    layouts = Layouts(fields, _after_head, PADDING)

    def read(data: Buffer) -> Any:
        message = _uncompressed(data)
        # The library takes XCDR2 for the first version, which aligns longer numbers differently.
        return layouts.read(message, None if bytes(message[1:2]) >= b"\6" else decode)

    def stamp(data: Buffer) -> Any:
        """Return the stamp, which is the first field, or in the header that is the first field."""
        first = _after_head(_uncompressed(data)).read(fields[:1])
        return first.timestamp if hasattr(first, "timestamp") else first.header.stamp

    return MessageReader(read, stamp, lambda data: layouts.fitting(data) is not None)


def _after_head(data: Buffer) -> FieldReader:
    """Return a reader of the fields after the head, which tells byte order and version."""
    if len(data) < 4:
        raise BadMessage("a message without a head")
    kind = data[1]
    order, start = "<" if kind & 1 else ">", 8 if kind in (8, 9) else 4
    return FieldReader(data, order, start, aligned=True, widest=4 if kind >= 6 else 8)


def _uncompressed(data: Buffer) -> Buffer:
    """Return a message without rosbag2's compression; CDR itself never begins like Zstandard."""
    if bytes(data[:4]) != _ZSTD:
        return data
    import zstandard

    if not 0 <= zstandard.frame_content_size(data) <= LARGEST:
        raise BadMessage("a compressed message of an impossible size")
    message: bytes = zstandard.ZstdDecompressor().decompress(data)
    return message


def flatbuffer(schema: Schema | None) -> MessageReader | None:
    """Return a reader of Foxglove's messages in FlatBuffers; None for other messages."""
    import foxglove_schemas_flatbuffer as schemas

    fields = fields_of(schema)
    if schema is None or fields is None or not schema.name.startswith("foxglove"):
        return None
    name = parts_of(schema.name)[-1]
    table = getattr(import_module(f"{schemas.__name__}.{name}"), name)
    return MessageReader(lambda data: _flatbuffer_fields(table.GetRootAs(data), fields))


def _flatbuffer_fields(message: Any, fields: Fields) -> SimpleNamespace:
    """Return the fields that accessors read, such as ``frame_id`` by ``FrameId``."""
    values: dict[str, Any] = {}
    for name, kind in fields:
        accessor = name.title().replace("_", "")
        value: Any
        if kind == "bytes":
            value = memoryview(getattr(message, f"{accessor}AsNumpy")())
        elif kind.endswith("]"):
            items = map(getattr(message, accessor), range(getattr(message, f"{accessor}Length")()))
            nested = NESTED.get(kind.partition("[")[0])
            value = [_flatbuffer_fields(item, nested) if nested else item for item in items]
        else:
            value = getattr(message, accessor)()
            if kind == "time":
                value = SimpleNamespace(sec=value.Sec(), nanosec=value.Nsec()) if value else None
            elif kind in NESTED:
                value = _flatbuffer_fields(value, NESTED[kind])
            elif kind == "str":
                value = (value or b"").decode("utf-8", "replace")
        values[name] = value
    return SimpleNamespace(**values)


def read_json(data: Buffer) -> Any:
    """Return a JSON message, which has its bytes in base 64 or as a list of numbers."""
    message = json.loads(bytes(data), object_hook=lambda fields: SimpleNamespace(**fields))
    if isinstance(content := getattr(message, "data", None), str):
        message.data = base64.b64decode(content, validate=True)
    elif hasattr(message, "data"):  # else it is not an image
        message.data = bytes([*message.data])  # an error for a number: bytes(5) is five zeros
    return message


def protobuf(schema: Schema | None) -> MessageReader | None:
    """Return a reader of Protocol Buffers by the descriptors in a schema."""
    from mcap_protobuf.decoder import DecoderFactory

    decode = decode_by_library(DecoderFactory(), "protobuf", schema)
    return decode and MessageReader(decode)


def ros1(schema: Schema | None) -> MessageReader | None:
    """Return a reader of the encoding of ROS 1: little-endian fields without alignment."""
    from mcap_ros1.decoder import DecoderFactory

    decode = decode_by_library(DecoderFactory(), "ros1", schema)
    fields = fields_of(schema)
    if fields is None:
        return decode and MessageReader(decode)
    layouts = Layouts(fields, partial(FieldReader, order="<", start=0, aligned=False))
    return MessageReader(lambda data: layouts.read(data, decode))


ENCODINGS = (
    Encoding("cdr", cdr),
    Encoding("flatbuffer", flatbuffer),
    Encoding("json", lambda _: MessageReader(read_json), without_schema=TopicKind.COMPRESSED),
    Encoding("protobuf", protobuf),
    Encoding("ros1", ros1),
)
