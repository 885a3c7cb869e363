"""From a message's bytes to the picture it carries, whatever the encoding of the message."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

from mcap.records import Channel, Schema

Buffer = bytes | memoryview


class Kind(StrEnum):
    """What a topic carries."""

    IMAGE = "image"
    COMPRESSED = "compressed"
    VIDEO = "video"
    OTHER = "other"


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


@dataclass(frozen=True, slots=True, eq=False)
class CompressedPicture:
    """An image file, or a packet of a video, with what the message says its format is."""

    stamp_ns: int
    format: str
    data: Buffer


Picture = RawPicture | CompressedPicture
Reader = Callable[[Buffer], Picture]

_KINDS: Final = {
    "Image": Kind.IMAGE,
    "RawImage": Kind.IMAGE,
    "CompressedImage": Kind.COMPRESSED,
    "CompressedVideo": Kind.VIDEO,
    "FFMPEGPacket": Kind.VIDEO,
}
_SECONDS: Final = ("sec", "secs", "seconds")
_NANOSECONDS: Final = ("nanosec", "nsec", "nsecs", "nanos", "nanoseconds")


class BadMessage(Exception):  # noqa: N818  (never leaves this room)
    """A message that cannot be decoded."""


def kind_of(schema: Schema | None) -> Kind:
    """Tell by its schema's name what a channel carries."""
    name = re.split(r"[/.:]", schema.name)[-1] if schema else ""
    return _KINDS.get(name, Kind.OTHER)


def reader_for(channel: Channel, schema: Schema | None) -> Reader:
    """Return what decodes the messages of a channel.

    The decoders are the `mcap` project's own. A new factory for each channel: they remember
    schemas by number alone, and numbers repeat from file to file.

    Raises
    ------
    BadMessage
        If nothing decodes them, or the schema cannot be understood.
    """
    for factory in _factories():
        try:
            decode = factory.decoder_for(channel.message_encoding, schema)
        except Exception as error:
            raise BadMessage(f"its schema cannot be understood: {_line(error)}") from error
        if decode is not None:
            return _reader(decode)
    name = schema.encoding if schema else "no"
    raise BadMessage(f"{channel.message_encoding!r} messages with {name!r} schema are not readable")


def _factories() -> list[Any]:
    from mcap_protobuf.decoder import DecoderFactory as Protobuf
    from mcap_ros1.decoder import DecoderFactory as Ros1
    from mcap_ros2.decoder import DecoderFactory as Ros2

    return [Ros2(), Protobuf(), Ros1()]


def _reader(decode: Callable[[bytes], Any]) -> Reader:
    def read(data: Buffer) -> Picture:
        try:
            return picture(decode(bytes(data)))
        except Exception as error:
            raise BadMessage(f"the message cannot be decoded: {_line(error)}") from error

    return read


def picture(message: Any) -> Picture:
    """Take the picture out of a decoded message by the names of its fields."""
    stamp_ns = _nanoseconds(_stamp(message))
    if hasattr(message, "step"):
        return RawPicture(
            stamp_ns,
            message.width,
            message.height,
            message.encoding,
            message.step,
            bool(getattr(message, "is_bigendian", False)),
            message.data,
        )
    name = message.format if hasattr(message, "format") else message.encoding
    return CompressedPicture(stamp_ns, name, message.data)


def _stamp(message: Any) -> Any:
    return message.header.stamp if hasattr(message, "header") else message.timestamp


def _nanoseconds(stamp: Any) -> int:
    """Integer nanoseconds of a stamp: a float would round them."""
    seconds = next(getattr(stamp, name) for name in _SECONDS if hasattr(stamp, name))
    rest = next(getattr(stamp, name) for name in _NANOSECONDS if hasattr(stamp, name))
    return int(seconds) * 1_000_000_000 + int(rest)


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
