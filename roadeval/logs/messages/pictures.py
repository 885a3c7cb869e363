"""Pictures as messages carry them: raw pixels, an image file, or a frame of a video.

A decoder makes one of a message's bytes, whatever the encoding of the message.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, Final, NamedTuple

from mcap.records import Channel, Schema

from roadeval.data import Rgb
from roadeval.logs.container.records import Buffer, Message
from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.messages import encodings
from roadeval.logs.messages.encoding import KINDS, Encoding, MessageReader, TopicKind, parts_of
from roadeval.logs.settings import parse_time
from roadeval.runtime.discovery import found_in


@dataclass(frozen=True, slots=True, eq=False)
class RawPicture:
    """Pixels as logged: ``height`` rows of ``step`` bytes (0: not said), in ``encoding``."""

    stamp_ns: int
    width: int
    height: int
    encoding: str
    step: int
    big_endian: bool
    data: Buffer
    frame_id: str = ""
    """The camera's name, as the header has it."""


@dataclass(frozen=True, slots=True, eq=False)
class CompressedPicture:
    """An image file, or a packet of a video, with what the message says its format is."""

    stamp_ns: int
    format: str
    data: Buffer
    frame_id: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class DecodedPicture:
    """A video's frame: its packet, and what became of it together with those before it.

    ``damage`` says what is wrong with the pixels; empty if nothing is.
    """

    stamp_ns: int
    data: Buffer
    pixels: Rgb
    damage: str = ""


BUFFERS: Final = (bytes, bytearray, memoryview)

LoggedPicture = RawPicture | CompressedPicture
Picture = LoggedPicture | DecodedPicture

_SECONDS: Final = ("sec", "secs", "seconds")
_NANOSECONDS: Final = ("nanosec", "nsec", "nsecs", "nanos", "nanoseconds")
_CODECS: Final = {
    "h264": "h264",
    "avc": "h264",
    "libx264": "h264",
    "h265": "hevc",
    "hevc": "hevc",
    "libx265": "hevc",
    "vp9": "vp9",
    "av1": "av1",
}
_START_CODES: Final = (b"\x00\x00\x00\x01", b"\x00\x00\x01")


def codec_of(picture: Picture) -> str | None:
    """Return the video codec of a packet, None for a picture that stands alone."""
    if not isinstance(picture, CompressedPicture):
        return None
    for word in re.split(r"[^a-z0-9]+", picture.format.lower()):
        if word in _CODECS:
            return _CODECS[word]
    return "h264" if bytes(picture.data[:4]).startswith(_START_CODES) else None


def picture_in(message: Any) -> LoggedPicture:
    """Return the picture of a decoded message, by the names of its fields.

    A `BadMessage` if it lacks the fields of an image.
    """
    try:
        stamp_ns, header = 0, getattr(message, "header", message)
        if header is not message:
            stamp_ns = nanoseconds(header.stamp)
        elif hasattr(message, "timestamp"):
            stamp_ns = nanoseconds(message.timestamp)
        frame_id = getattr(header, "frame_id", "")
        frame_id = frame_id if isinstance(frame_id, str) else ""
        if not hasattr(message, "height") or hasattr(message, "pts"):
            name = message.format if hasattr(message, "format") else message.encoding
            data = _as(BUFFERS, message.data)
            return CompressedPicture(stamp_ns, _as(str, name), data, frame_id)
        return RawPicture(
            stamp_ns,
            int(message.width),
            int(message.height),
            _as(str, message.encoding),
            int(getattr(message, "step", 0)),
            bool(getattr(message, "is_bigendian", False)),
            _as(BUFFERS, message.data),
            frame_id,
        )
    except (AttributeError, StopIteration, TypeError, ValueError, LogError) as error:
        raise BadMessage("it lacks the fields of an image") from error


def _as(kind: type | tuple[type, ...], value: Any) -> Any:
    """Return a value, whose kind a damaged schema may have changed: a TypeError if so."""
    if not isinstance(value, kind):
        raise TypeError(value)
    return value


def nanoseconds(stamp: Any) -> int:
    """Return the nanoseconds of a stamp in any of its forms, exactly."""
    if isinstance(stamp, str):
        return parse_time(stamp)
    seconds = next(getattr(stamp, name) for name in _SECONDS if hasattr(stamp, name))
    rest = next((getattr(stamp, name) for name in _NANOSECONDS if hasattr(stamp, name)), 0)
    return int(seconds) * 1_000_000_000 + int(rest)


class Decoder(NamedTuple):
    """Reads the messages of a channel: the whole picture, or only its stamp in nanoseconds.

    Both raise `BadMessage` for a message that cannot be decoded.
    """

    picture: Callable[[Buffer], LoggedPicture]
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
    """Return what decodes the messages of a channel; a `BadMessage` if nothing decodes them."""
    reader = _reader(channel, schema)
    if reader is None:
        name = schema.encoding if schema else "no"
        raise BadMessage(
            f"{channel.message_encoding!r} messages with {name!r} schema are not readable"
        )

    def picture(data: Buffer) -> LoggedPicture:
        with _one_error():
            return picture_in(reader.decode(data))

    def stamp(data: Buffer) -> int:
        if reader.stamp is None:
            return picture(data).stamp_ns
        with _one_error():
            return nanoseconds(reader.stamp(data))

    return Decoder(picture, stamp)


def message_stamp(channel: Channel, schema: Schema | None, message: Message) -> int | None:
    """Return a message's stamp; None if its fields contradict its length or cannot be read."""
    reader = _reader(channel, schema)
    if reader is not None and reader.is_whole is not None and not reader.is_whole(message.data):
        return None
    try:
        return decoder_for(channel, schema).picture(message.data).stamp_ns
    except BadMessage:
        return None


def _reader(channel: Channel, schema: Schema | None) -> MessageReader | None:
    parts = () if schema is None else (schema.name, schema.encoding, schema.data)
    return _reader_for(channel.message_encoding, *parts)


@lru_cache(maxsize=64)
def _reader_for(message_encoding: str, *parts: Any) -> MessageReader | None:
    """Return what reads the messages of a schema, whichever channels and files share it."""
    encoding = message_encodings().get(message_encoding)
    if encoding is None:
        return None
    name, schema_encoding, data = parts or ("", "", b"")
    schema = Schema(id=1, name=name, encoding=schema_encoding, data=data) if parts else None
    return encoding.reader(schema)


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
