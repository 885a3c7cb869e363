"""The encoding of ROS 1: fields in the machine's order, without alignment."""

from __future__ import annotations

from functools import partial

from mcap.records import Schema

from roadeval.logs.messages.encoding import (
    Encoding,
    FieldReader,
    Layouts,
    MessageReader,
    decode_by_library,
    fields_of,
)


def _reader(schema: Schema | None) -> MessageReader | None:
    from mcap_ros1.decoder import DecoderFactory

    decode = decode_by_library(DecoderFactory(), "ros1", schema)
    fields = fields_of(schema)
    if fields is None:
        return None if decode is None else MessageReader(decode)
    layouts = Layouts(fields, partial(FieldReader, order="<", start=0, aligned=False))
    return MessageReader(lambda data: layouts.read(data, decode))


ENCODING = Encoding("ros1", _reader)
