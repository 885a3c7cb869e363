"""FlatBuffers, for Foxglove's image messages."""

from __future__ import annotations

from functools import partial
from importlib import import_module
from types import SimpleNamespace
from typing import Any

from mcap.records import Schema

from roadeval.logs.container.records import Buffer
from roadeval.logs.messages.encoding import Encoding, Fields, MessageReader, fields_of, parts_of


def _reader(schema: Schema | None) -> MessageReader | None:
    import foxglove_schemas_flatbuffer as schemas

    fields = fields_of(schema)
    if schema is None or fields is None or not schema.name.startswith("foxglove"):
        return None
    name = parts_of(schema.name)[-1]
    table = getattr(import_module(f"{schemas.__name__}.{name}"), name)
    return MessageReader(partial(_decode, table, fields))


def _decode(table: Any, fields: Fields, data: Buffer) -> SimpleNamespace:
    message = table.GetRootAs(data)
    return SimpleNamespace(**{name: _field(message, name, kind) for name, kind in fields})


def _field(message: Any, name: str, kind: str) -> Any:
    """Read a field by its accessor: ``frame_id`` by ``FrameId``."""
    accessor = name.title().replace("_", "")
    if kind == "bytes":
        return memoryview(getattr(message, f"{accessor}AsNumpy")())
    value = getattr(message, accessor)()
    if kind == "time":
        return SimpleNamespace(sec=value.Sec(), nanosec=value.Nsec()) if value else None
    return (value or b"").decode("utf-8", "replace") if kind == "str" else value


ENCODING = Encoding("flatbuffer", _reader)
