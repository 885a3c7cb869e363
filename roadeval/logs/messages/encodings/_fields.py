"""Fields one after the other, as ROS 1 and CDR store them."""

from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import Any, Final

from roadeval.logs.container.readers import Buffer
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.schemas import Fields

_CODES: Final = {"u1": "B", "u4": "I", "i4": "i", "u8": "Q"}


class FieldReader:
    """Reads one field after the other.

    Parameters
    ----------
    order, start
        Byte order as `struct` names it, and the position of the first field.
    aligned, widest
        Whether numbers stand at multiples of their size, and the largest such size.
    """

    def __init__(
        self, data: Buffer, order: str, start: int, *, aligned: bool, widest: int = 8
    ) -> None:
        self._data = memoryview(data)
        self._order = order
        self._start = self._at = start
        self._aligned = aligned
        self._widest = widest

    @property
    def left(self) -> int:
        """Bytes not read yet."""
        return len(self._data) - self._at

    def read(self, fields: Fields) -> SimpleNamespace:
        """Read a message's fields, or the first of them."""
        return SimpleNamespace(**{name: self._field(kind) for name, kind in fields})

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
