"""CDR, the encoding of ROS 2: of either byte order, or XCDR2; compressed by rosbag2 or not."""

from __future__ import annotations

from typing import Any, Final

from mcap.records import Schema

from roadeval.logs.container.records import LARGEST, PADDING, Buffer
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.encoding import (
    Encoding,
    FieldReader,
    Fields,
    Layouts,
    MessageReader,
    decode_by_library,
    fields_of,
)

_ZSTD: Final = b"\x28\xb5\x2f\xfd"


def _reader(schema: Schema | None) -> MessageReader | None:
    from mcap_ros2.decoder import DecoderFactory

    decode = decode_by_library(DecoderFactory(), "cdr", schema)
    fields = fields_of(schema)
    if fields is None:
        return None if decode is None else MessageReader(lambda data: decode(_uncompressed(data)))
    layouts = Layouts(fields, _after_head, PADDING)
    return MessageReader(
        lambda data: layouts.read(_uncompressed(data), decode),
        lambda data: _stamp(fields, _uncompressed(data)),
        lambda data: layouts.fits(fields, data),
    )


def _stamp(fields: Fields, data: Buffer) -> Any:
    """Read only the first field, which is the stamp or a header that holds it."""
    first = _after_head(data).read(fields[:1])
    return first.timestamp if hasattr(first, "timestamp") else first.header.stamp


def _after_head(data: Buffer) -> FieldReader:
    """Begin after the encapsulation: its second byte names byte order and version."""
    if len(data) < 4:
        raise BadMessage("a message without a head")
    kind = data[1]
    order = "<" if kind & 1 else ">"
    version_2 = kind >= 6
    delimited = kind in (8, 9)
    start = 8 if delimited else 4
    return FieldReader(data, order, start, aligned=True, widest=4 if version_2 else 8)


def _uncompressed(data: Buffer) -> Buffer:
    """Undo rosbag2's compression message by message; CDR itself never begins like zstd."""
    if bytes(data[:4]) != _ZSTD:
        return data
    import zstandard

    if not 0 <= zstandard.frame_content_size(data) <= LARGEST:
        raise BadMessage("a compressed message of a size that cannot be")
    message: bytes = zstandard.ZstdDecompressor().decompress(data)
    return message


ENCODING = Encoding("cdr", _reader)
