"""Message encodings: from a message's bytes to its fields.

Messages of images, calibrations, transforms and classes are recognised by their schema's name. The
layouts of ROS, ``ffmpeg_image_transport_msgs`` and Foxglove are known; they are used if a schema
has no text, or a text that no library reads.
"""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Callable
from contextlib import redirect_stderr, suppress
from dataclasses import dataclass
from enum import StrEnum
from types import SimpleNamespace
from typing import Any, Final, NamedTuple

from mcap.records import Schema

from roadeval.logs.container.records import Buffer
from roadeval.logs.errors import BadMessage


class TopicKind(StrEnum):
    """The content of a topic."""

    IMAGE = "image"
    COMPRESSED = "compressed"
    VIDEO = "video"
    CALIBRATION = "calibration"
    TRANSFORMS = "transforms"
    CLASSES = "classes"
    NAMES = "names"
    OTHER = "other"


Fields = tuple[tuple[str, str], ...]
"""Names and types of a message's fields, in the order of their bytes."""
_CODES: Final = {"u1": "B", "u2": "H", "f4": "f", "u4": "I", "i4": "i", "u8": "Q", "f8": "d"}
"""Codes of `struct` for the types that are numbers."""


def _fields(text: str) -> Fields:
    pairs = (field.partition(":") for field in text.split())
    return tuple((name, type_) for name, _, type_ in pairs)


_ROS: Final = "header:header"
_FOXGLOVE: Final = "timestamp:time frame_id:str"
_LENS: Final = "distortion_model:str d:f8[] k:f8[9] r:f8[9] p:f8[12]"
_MOVED: Final = "translation:vector rotation:quaternion"
_FRAME: Final = f"timestamp:time parent_frame_id:str child_frame_id:str {_MOVED}"
NESTED: Final = {
    "time": _fields("sec:u4 nanosec:u4"),
    "header": _fields("stamp:time frame_id:str"),
    "region": _fields("x_offset:u4 y_offset:u4 height:u4 width:u4 do_rectify:u1"),
    "vector": _fields("x:f8 y:f8 z:f8"),
    "quaternion": _fields("x:f8 y:f8 z:f8 w:f8"),
    "moved": _fields(_MOVED),
    "stamped": _fields(f"{_ROS} child_frame_id:str transform:moved"),
    "frame": _fields(_FRAME),
    "class": _fields("class_id:u2 class_name:str"),
}
"""The fields of types that are messages themselves."""

_KINDS_AND_FIELDS: Final = {
    "sensor_msgs/Image": (
        TopicKind.IMAGE,
        f"{_ROS} height:u4 width:u4 encoding:str is_bigendian:u1 step:u4 data:bytes",
    ),
    "sensor_msgs/CompressedImage": (TopicKind.COMPRESSED, f"{_ROS} format:str data:bytes"),
    "ffmpeg_image_transport_msgs/FFMPEGPacket": (
        TopicKind.VIDEO,
        f"{_ROS} width:i4 height:i4 encoding:str pts:u8 flags:u1 is_bigendian:u1 data:bytes",
    ),
    "foxglove/RawImage": (
        TopicKind.IMAGE,
        f"{_FOXGLOVE} width:u4 height:u4 encoding:str step:u4 data:bytes",
    ),
    "foxglove/CompressedImage": (TopicKind.COMPRESSED, f"{_FOXGLOVE} data:bytes format:str"),
    "foxglove/CompressedVideo": (TopicKind.VIDEO, f"{_FOXGLOVE} data:bytes format:str"),
    "sensor_msgs/CameraInfo": (
        TopicKind.CALIBRATION,
        f"{_ROS} height:u4 width:u4 {_LENS} binning_x:u4 binning_y:u4 roi:region",
    ),
    "foxglove/CameraCalibration": (
        TopicKind.CALIBRATION,
        f"{_FOXGLOVE} width:u4 height:u4 {_LENS}",
    ),
    "tf2_msgs/TFMessage": (TopicKind.TRANSFORMS, "transforms:stamped[]"),
    "foxglove/FrameTransform": (TopicKind.TRANSFORMS, _FRAME),
    "foxglove/FrameTransforms": (TopicKind.TRANSFORMS, "transforms:frame[]"),
    "vision_msgs/LabelInfo": (TopicKind.CLASSES, f"{_ROS} class_map:class[] threshold:f4"),
    "roadeval/ImageNames": (TopicKind.NAMES, ""),
}
"""Kinds and fields of messages, by package and message."""
LAYOUTS: Final = {name: _fields(fields) for name, (_, fields) in _KINDS_AND_FIELDS.items()}
KINDS: Final = {name.partition("/")[2]: kind for name, (kind, _) in _KINDS_AND_FIELDS.items()}
"""Kinds by the message alone, because another package may have fields of the same names."""
PICTURES: Final = (TopicKind.IMAGE, TopicKind.COMPRESSED, TopicKind.VIDEO)


def parts_of(schema_name: str) -> list[str]:
    """Split a name such as ``sensor_msgs/msg/Image``, ``foxglove.RawImage`` or ``a::b``."""
    return [part for part in re.split(r"[/.:]", schema_name) if part]


def fields_of(schema: Schema | None) -> Fields | None:
    """Return the fields of a message by its schema's name; None if that is unknown.

    >>> fields_of(Schema(1, b"", "", "foxglove_msgs/msg/CompressedVideo"))
    (('timestamp', 'time'), ('frame_id', 'str'), ('data', 'bytes'), ('format', 'str'))
    """
    parts = parts_of(schema.name) if schema else []
    if len(parts) < 2:
        return None
    package = "foxglove" if parts[0] == "foxglove_msgs" else parts[0]
    return LAYOUTS.get(f"{package}/{parts[-1]}")


Decode = Callable[[Buffer], Any]
"""Decode the bytes of a message to an object with its fields as attributes."""


class MessageReader(NamedTuple):
    """Reads the messages of one channel; any exception means that a message cannot be decoded."""

    decode: Decode
    """Return a message with the fields of an image by their names in ROS or Foxglove: ``data`` and
    ``format``, or ``data``, ``width``, ``height``, ``encoding`` and ``step``; the stamp in
    ``header.stamp`` or ``timestamp``, the camera's name in ``header.frame_id`` or ``frame_id``."""
    stamp: Decode | None = None
    """Return the stamp alone, if that is cheaper than to decode the message."""
    is_whole: Callable[[Buffer], bool] = lambda _: True
    """Return whether a message that can be decoded is exactly as long as its fields."""


@dataclass(frozen=True)
class Encoding:
    """A message encoding."""

    name: str
    """A channel's ``message_encoding``."""
    reader: Callable[[Schema | None], MessageReader | None]
    """Return the reader of a schema's messages, or None if there is none."""
    without_schema: TopicKind = TopicKind.OTHER
    """The kind that a channel without a schema may have; its first messages decide."""


def decode_by_library(factory: Any, encoding: str, schema: Schema | None) -> Decode | None:
    """Return a decoder of the `mcap` project by a schema's text, or None if it has none.

    ``factory`` is a new ``DecoderFactory``: it remembers schemas by number, and numbers repeat from
    file to file. ``encoding`` is the channel's message encoding.
    """
    # The parsers' time grows with the square of the text.
    if schema is None or not 0 < len(schema.data) <= 1 << 16:
        return None
    try:
        with redirect_stderr(io.StringIO()):  # the ROS parsers print their errors
            decode = factory.decoder_for(encoding, schema)
    except Exception:  # the text can be wrong in any way; the name may still be right
        return None
    return None if decode is None else lambda data: decode(bytes(data))


class FieldReader:
    """Reads one field after the other.

    ``order`` is the byte order in the notation of `struct`, ``start`` the position of the first
    field. If ``aligned``, numbers lie at multiples of their size, at most of ``widest``.
    """

    def __init__(
        self, data: Buffer, order: str, start: int, *, aligned: bool, widest: int = 8
    ) -> None:
        self._data, self._order = memoryview(data), order
        self._start = self._at = start
        self._aligned, self._widest = aligned, widest

    @property
    def left(self) -> int:
        """Bytes that are not read yet."""
        return len(self._data) - self._at

    def read(self, fields: Fields) -> SimpleNamespace:
        """Read a message's fields, or the first of them."""
        return SimpleNamespace(**{name: self._field(kind) for name, kind in fields})

    def _field(self, kind: str) -> Any:
        if kind == "header" and not self._aligned:
            self._number("u4")  # headers of ROS 1 have a number
        if kind in NESTED:
            return self.read(NESTED[kind])
        if kind == "str":
            return bytes(self._take(self._number("u4"))).rstrip(b"\0").decode("utf-8", "replace")
        if kind == "bytes":
            return self._take(self._number("u4"))
        if kind.endswith("]"):
            kind, _, length = kind[:-1].partition("[")
            items = int(length or self._number("u4"))
            # Each takes at least eight bytes; a damaged number of items would take for ever.
            return [self._field(kind) for _ in range(min(items, self.left // 8 + 1))]
        return self._number(kind)

    def _number(self, kind: str) -> Any:
        code = struct.Struct(self._order + _CODES[kind])
        if self._aligned:
            self._at += -(self._at - self._start) % min(code.size, self._widest)
        return code.unpack(self._take(code.size))[0]

    def _take(self, length: int) -> memoryview:
        if length > self.left:
            raise BadMessage("a message that is cut off")
        self._at += length
        return self._data[self._at - length : self._at]


@dataclass(frozen=True)
class Layouts:
    """The possible layouts of the messages of a channel.

    Some writers log two kinds of messages on a topic, with the schema of the first.
    """

    named: Fields
    """The layout of the channel's schema."""
    begin: Callable[[Buffer], FieldReader]
    """Return a reader of a message's fields."""
    padding: int = 1
    """A message may be longer by fewer bytes than this."""

    def read(self, data: Buffer, decode: Decode | None) -> Any:
        """Read a message by ``decode``, or by another image's layout if only that fits.

        A message of another kind is read by its layout if that fits, because the libraries refuse
        some texts of schemas.
        """
        is_image = ("data", "bytes") in self.named
        if message := self.fitting(data):
            return decode(data) if decode and is_image else message
        if decode is None and not is_image:
            raise BadMessage("its length is not that of its fields")
        for fields in LAYOUTS.values():
            if fields[0] == self.named[0] and (message := self.fitting(data, fields)):
                return message
        return decode(data) if decode else self.begin(data).read(self.named)

    def fitting(self, data: Buffer, fields: Fields | None = None) -> SimpleNamespace | None:
        """Read a message by its own or other fields; None if its length does not fit them."""
        with suppress(BadMessage, struct.error):
            reader = self.begin(data)
            message = reader.read(fields or self.named)
            return message if reader.left < self.padding else None
        return None
