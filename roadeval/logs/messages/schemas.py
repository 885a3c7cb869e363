"""The image messages that are known by their schema's name, whatever the schema's text.

The layouts are those of ROS's ``sensor_msgs``, of ``ffmpeg_image_transport_msgs`` and of Foxglove's
schemas; they serve where a schema has no text, or one in a language that no library reads.
"""

from __future__ import annotations

import re
from enum import StrEnum
from typing import Final, NamedTuple

from mcap.records import Schema


class TopicKind(StrEnum):
    """What a topic carries."""

    IMAGE = "image"
    COMPRESSED = "compressed"
    VIDEO = "video"
    OTHER = "other"


Fields = tuple[tuple[str, str], ...]
"""Names and types of a message's fields, in the order of their bytes."""


class ImageSchema(NamedTuple):
    """A message that carries an image."""

    kind: TopicKind
    fields: Fields


def _schema(kind: TopicKind, fields: str) -> ImageSchema:
    pairs = (field.partition(":") for field in fields.split())
    return ImageSchema(kind, tuple((name, type_) for name, _, type_ in pairs))


_ROS: Final = "header:header"
_FOXGLOVE: Final = "timestamp:time frame_id:str"

SCHEMAS: Final = {
    "sensor_msgs/Image": _schema(
        TopicKind.IMAGE,
        f"{_ROS} height:u4 width:u4 encoding:str is_bigendian:u1 step:u4 data:bytes",
    ),
    "sensor_msgs/CompressedImage": _schema(TopicKind.COMPRESSED, f"{_ROS} format:str data:bytes"),
    "ffmpeg_image_transport_msgs/FFMPEGPacket": _schema(
        TopicKind.VIDEO,
        f"{_ROS} width:i4 height:i4 encoding:str pts:u8 flags:u1 is_bigendian:u1 data:bytes",
    ),
    "foxglove/RawImage": _schema(
        TopicKind.IMAGE, f"{_FOXGLOVE} width:u4 height:u4 encoding:str step:u4 data:bytes"
    ),
    "foxglove/CompressedImage": _schema(TopicKind.COMPRESSED, f"{_FOXGLOVE} data:bytes format:str"),
    "foxglove/CompressedVideo": _schema(TopicKind.VIDEO, f"{_FOXGLOVE} data:bytes format:str"),
}
"""By package and message."""

KINDS: Final = {name.partition("/")[2]: schema.kind for name, schema in SCHEMAS.items()}
"""By the message alone: its package may be another, with fields of the same names."""


def parts_of(schema_name: str) -> list[str]:
    """Split a name such as ``sensor_msgs/msg/Image``, ``foxglove.RawImage`` or ``a::b``."""
    return [part for part in re.split(r"[/.:]", schema_name) if part]


def fields_of(schema: Schema | None) -> Fields | None:
    """Return the fields of a message whose schema's name is known.

    >>> fields_of(Schema(1, b"", "", "foxglove_msgs/msg/CompressedVideo"))
    (('timestamp', 'time'), ('frame_id', 'str'), ('data', 'bytes'), ('format', 'str'))
    """
    parts = parts_of(schema.name) if schema else []
    if len(parts) < 2:
        return None
    package = "foxglove" if parts[0] == "foxglove_msgs" else parts[0]
    found = SCHEMAS.get(f"{package}/{parts[-1]}")
    return found.fields if found else None
