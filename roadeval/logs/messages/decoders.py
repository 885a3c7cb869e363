"""From a message's bytes to the picture it carries, whatever the encoding of the message."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from typing import NamedTuple

from mcap.records import Channel, Schema

from roadeval.logs.container.readers import Buffer
from roadeval.logs.container.records import Message
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages import encodings
from roadeval.logs.messages.encoding import Encoding, MessageReader
from roadeval.logs.messages.pictures import Picture, nanoseconds, picture_in
from roadeval.logs.messages.schemas import KINDS, TopicKind, parts_of
from roadeval.runtime.discovery import found_in


class Decoder(NamedTuple):
    """Reads the messages of a channel: the whole picture, or only its stamp in nanoseconds.

    Both raise `BadMessage` for a message that cannot be decoded.
    """

    picture: Callable[[Buffer], Picture]
    stamp: Callable[[Buffer], int]


@cache
def message_encodings() -> Mapping[str, Encoding]:
    """Return the message encodings of the folder, by name."""
    return {encoding.name: encoding for encoding in found_in(encodings, "ENCODING")}


def kind_of(channel: Channel, schema: Schema | None) -> TopicKind:
    """Return what a channel carries, by its schema's name."""
    encoding = message_encodings().get(channel.message_encoding)
    if schema is None:
        return encoding.without_schema if encoding else TopicKind.OTHER
    kinds = {**KINDS, **encoding.kinds} if encoding else KINDS
    return kinds.get((parts_of(schema.name) or [""])[-1], TopicKind.OTHER)


def decoder_for(channel: Channel, schema: Schema | None) -> Decoder:
    """Return what decodes the messages of a channel.

    Raises
    ------
    BadMessage
        If nothing decodes them.
    """
    reader = _reader(channel, schema)
    if reader is None:
        name = schema.encoding if schema else "no"
        raise BadMessage(
            f"{channel.message_encoding!r} messages with {name!r} schema are not readable"
        )

    def picture(data: Buffer) -> Picture:
        with _one_error():
            return picture_in(reader.decode(data))

    def stamp(data: Buffer) -> int:
        if reader.stamp is None:
            return picture(data).stamp_ns
        with _one_error():
            return nanoseconds(reader.stamp(data))

    return Decoder(picture, stamp)


def message_is_whole(channel: Channel, schema: Schema | None, message: Message) -> bool:
    """Whether a message is as long as its own fields say, as far as its encoding shows it."""
    reader = _reader(channel, schema)
    if reader is not None and reader.is_whole is not None:
        return reader.is_whole(message.data)
    try:
        decoder_for(channel, schema).picture(message.data)
    except BadMessage:
        return False
    return True


def _reader(channel: Channel, schema: Schema | None) -> MessageReader | None:
    encoding = message_encodings().get(channel.message_encoding)
    return encoding.reader(schema) if encoding else None


@contextmanager
def _one_error() -> Iterator[None]:
    """Turn whatever the libraries' parsers raise into a `BadMessage`."""
    try:
        yield
    except BadMessage:
        raise
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BadMessage(f"the message cannot be decoded: {reason}") from error
