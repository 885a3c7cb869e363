"""Message encodings: from a message's bytes to its fields."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from contextlib import redirect_stderr
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from mcap.records import Schema

from roadeval.logs.container.readers import Buffer
from roadeval.logs.messages.schemas import TopicKind

Decode = Callable[[Buffer], Any]
"""From a message's bytes to an object that has its fields as attributes."""


class MessageReader(NamedTuple):
    """Reads the messages of one channel; any exception means that a message cannot be decoded.

    Parameters
    ----------
    decode
        Return a message with the fields of an image, named as ROS or Foxglove name them:
        ``data`` and ``format``, or ``data``, ``width``, ``height``, ``encoding`` and ``step``; and
        the stamp in ``header.stamp`` or ``timestamp``.
    stamp
        Return the stamp alone, where that is cheaper than to decode the message.
    is_whole
        Return whether a message is exactly as long as its fields say. Without it, a message is
        whole if it can be decoded.
    """

    decode: Decode
    stamp: Decode | None = None
    is_whole: Callable[[Buffer], bool] | None = None


@dataclass(frozen=True, slots=True)
class Encoding:
    """A message encoding.

    Parameters
    ----------
    name
        A channel's ``message_encoding``.
    reader
        Return what reads the messages of a schema, or None if nothing does.
    kinds
        What messages carry by the last part of their schema's name, for schemas that are not in
        `roadeval.logs.messages.schemas`.
    without_schema
        What the messages of a channel without a schema may carry; the first ones are looked at.
    """

    name: str
    reader: Callable[[Schema | None], MessageReader | None]
    kinds: Mapping[str, TopicKind] = field(default_factory=dict)
    without_schema: TopicKind = TopicKind.OTHER


def decode_by_library(factory: Any, encoding: str, schema: Schema | None) -> Decode | None:
    """Return a decoder of the `mcap` project by a schema's text, or None if it has none.

    Parameters
    ----------
    factory
        A new ``DecoderFactory``: they remember schemas by number, and numbers repeat from file to
        file.
    encoding
        The channel's message encoding.
    """
    if schema is None or not schema.data:
        return None
    try:
        with redirect_stderr(io.StringIO()):  # the ROS parsers print what they stumble on
            decode = factory.decoder_for(encoding, schema)
    except Exception:  # a schema's text can be wrong in any way; its name may still do
        return None
    return None if decode is None else lambda data: decode(bytes(data))
