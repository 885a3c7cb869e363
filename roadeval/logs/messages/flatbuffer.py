"""Foxglove's image messages in FlatBuffers, read by their fields' numbers.

The layout is that of https://flatbuffers.dev/internals: a table points back to its list of
field offsets; strings and vectors are behind a relative offset and begin with their length.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Final

from roadeval.logs.container.source import Buffer
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.layouts import Layout

_U2: Final = struct.Struct("<H")
_U4: Final = struct.Struct("<I")
_I4: Final = struct.Struct("<i")
_TIME: Final = struct.Struct("<II")


def flatbuffer_reader(layout: Layout) -> Callable[[Buffer], Any]:
    """Return what reads a message; the fields' numbers are their order in the layout."""

    def read(data: Buffer) -> SimpleNamespace:
        view = memoryview(data)
        try:
            table = _U4.unpack_from(view, 0)[0]
            values = {
                name: _field(view, table, number, kind)
                for number, (name, kind) in enumerate(layout)
            }
        except struct.error as error:
            raise BadMessage("a message that is cut off") from error
        return SimpleNamespace(**values)

    return read


def _field(view: memoryview, table: int, number: int, kind: str) -> Any:
    """Read a field; one that is not there has its type's zero."""
    entries = table - _I4.unpack_from(view, table)[0]
    slot = 4 + 2 * number
    offset = _U2.unpack_from(view, entries + slot)[0] if slot < _size(view, entries) else 0
    at = table + offset
    if kind == "time":
        sec, nanosec = _TIME.unpack_from(view, at) if offset else (0, 0)
        return SimpleNamespace(sec=sec, nanosec=nanosec)
    if kind in ("str", "bytes"):
        data = _vector(view, at) if offset else memoryview(b"")
        return bytes(data).decode("utf-8", "replace") if kind == "str" else data
    return _U4.unpack_from(view, at)[0] if offset else 0


def _size(view: memoryview, entries: int) -> int:
    size: int = _U2.unpack_from(view, entries)[0]
    return size


def _vector(view: memoryview, at: int) -> memoryview:
    begin = at + _U4.unpack_from(view, at)[0]
    length = _U4.unpack_from(view, begin)[0]
    if begin + 4 + length > len(view):
        raise BadMessage("a message that is cut off")
    return view[begin + 4 : begin + 4 + length]
