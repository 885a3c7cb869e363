"""Fields one after the other, as ROS 1 and CDR store them."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Final

from roadeval.logs.container.readers import Buffer
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.encoding import Decode
from roadeval.logs.messages.schemas import SCHEMAS, Fields

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


@dataclass(frozen=True, slots=True)
class Layouts:
    """The layouts that messages of a channel can have.

    Some writers log two kinds of message on a topic under the schema of the first.

    Parameters
    ----------
    own
        The one that the channel's schema names.
    begin
        Return a reader of a message's fields.
    padding
        A message may be longer by fewer bytes than that.
    """

    own: Fields
    begin: Callable[[Buffer], FieldReader]
    padding: int = 1

    def read(self, data: Buffer, decode: Decode | None) -> Any:
        """Read a message by ``decode``, or by another image's layout if it fits that alone."""
        if not self.fits(self.own, data):
            for fields in self._others():
                if self.fits(fields, data):
                    return self.begin(data).read(fields)
        return decode(data) if decode else self.begin(data).read(self.own)

    def fits(self, fields: Fields, data: Buffer) -> bool:
        """Whether a message is exactly as long as these fields say."""
        try:
            reader = self.begin(data)
            reader.read(fields)
        except (BadMessage, struct.error):
            return False
        return reader.left < self.padding

    def _others(self) -> list[Fields]:
        """Return the layouts that begin as the own one does."""
        known = (schema.fields for schema in SCHEMAS.values())
        return [each for each in known if each[0] == self.own[0] and each != self.own]
