"""The few image messages whose layout is fixed, for schemas that no library reads.

The layouts are those of ROS's ``sensor_msgs``, of ``ffmpeg_image_transport_msgs`` and of
Foxglove's schemas, known by the schema's *name*; its text (IDL, or nothing) does not matter.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Final

from roadeval.logs.container.source import Buffer
from roadeval.logs.errors import BadMessage

_ROS_STAMP: Final = "header:header"
_FOX_STAMP: Final = "timestamp:time frame_id:str"

LAYOUTS: Final = {
    name: tuple(tuple(field.split(":")) for field in fields.split())
    for name, fields in {
        "sensor_msgs/Image": f"{_ROS_STAMP} height:u4 width:u4 encoding:str is_bigendian:u1 "
        "step:u4 data:bytes",
        "sensor_msgs/CompressedImage": f"{_ROS_STAMP} format:str data:bytes",
        "ffmpeg_image_transport_msgs/FFMPEGPacket": f"{_ROS_STAMP} width:i4 height:i4 "
        "encoding:str pts:u8 flags:u1 is_bigendian:u1 data:bytes",
        "foxglove/RawImage": f"{_FOX_STAMP} width:u4 height:u4 encoding:str step:u4 data:bytes",
        "foxglove/CompressedImage": f"{_FOX_STAMP} data:bytes format:str",
        "foxglove/CompressedVideo": f"{_FOX_STAMP} data:bytes format:str",
    }.items()
}
"""Fields in the order of their bytes, by package and message."""

_CODES: Final = {"u1": "B", "u4": "I", "i4": "i", "u8": "Q"}
PADDING: Final = 4
"""CDR may pad a message's end to a multiple of so many bytes."""

Layout = tuple[tuple[str, ...], ...]


def layout_of(schema_name: str) -> Layout | None:
    """Find the layout by a schema's name, as ``sensor_msgs/msg/Image`` or ``foxglove.RawImage``."""
    parts = [part for part in schema_name.replace("::", "/").replace(".", "/").split("/") if part]
    if len(parts) < 2:
        return None
    package = "foxglove" if parts[0] == "foxglove_msgs" else parts[0]
    return LAYOUTS.get(f"{package}/{parts[-1]}")


def cdr_reader(layout: Layout) -> Callable[[Buffer], Any]:
    """Return what reads a message in CDR, of either byte order, or in XCDR2."""
    return lambda data: _Cursor.cdr(data).read(layout)


def ros1_reader(layout: Layout) -> Callable[[Buffer], Any]:
    """Return what reads a message in ROS 1's own encoding."""
    return lambda data: _Cursor(data, "<", 0, aligned=False).read(layout)


def is_whole(layout: Layout, data: Buffer) -> bool:
    """Whether a CDR message is exactly as long as its own fields say."""
    try:
        cursor = _Cursor.cdr(data)
        cursor.read(layout)
    except BadMessage:
        return False
    return cursor.left < PADDING


def stamp_of(layout: Layout, data: Buffer) -> Any:
    """Read only the stamp of a CDR message: the first field, alone or in a header."""
    first = _Cursor.cdr(data).read(layout[:1])
    return first.timestamp if hasattr(first, "timestamp") else first.header.stamp


class _Cursor:
    """Reads one field after the other."""

    def __init__(
        self, data: Buffer, order: str, start: int, *, aligned: bool, widest: int = 8
    ) -> None:
        self._data = memoryview(data)
        self._order = order
        self._start = self._at = start
        self._aligned = aligned
        self._widest = widest

    @classmethod
    def cdr(cls, data: Buffer) -> _Cursor:
        """Begin after the encapsulation: its second byte tells order and version."""
        if len(data) < 4:
            raise BadMessage("a message without a head")
        kind = data[1]
        order = "<" if kind & 1 else ">"
        version_2 = kind >= 6
        delimited = kind in (8, 9)
        return cls(data, order, 8 if delimited else 4, aligned=True, widest=4 if version_2 else 8)

    @property
    def left(self) -> int:
        """Bytes not read yet."""
        return len(self._data) - self._at

    def read(self, layout: Layout) -> SimpleNamespace:
        """Read the fields of a layout."""
        return SimpleNamespace(**{name: self._field(kind) for name, kind in layout})

    def _field(self, kind: str) -> Any:
        if kind == "header":
            if not self._aligned:
                self._number("u4")  # ROS 1 counts its headers
            return SimpleNamespace(stamp=self._field("time"), frame_id=self._field("str"))
        if kind == "time":
            return SimpleNamespace(sec=self._number("u4"), nanosec=self._number("u4"))
        if kind == "str":
            return bytes(self._take(self._number("u4"))).rstrip(b"\0").decode("utf-8", "replace")
        if kind == "bytes":
            return self._take(self._number("u4"))
        return self._number(kind)

    def _number(self, kind: str) -> int:
        code = struct.Struct(self._order + _CODES[kind])
        if self._aligned:
            width = min(code.size, self._widest)
            self._at += -(self._at - self._start) % width
        value: int = code.unpack(self._take(code.size))[0]
        return value

    def _take(self, length: int) -> memoryview:
        if length > self.left:
            raise BadMessage("a message that is cut off")
        self._at += length
        return self._data[self._at - length : self._at]
