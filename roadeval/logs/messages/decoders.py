"""From a message's bytes to the picture it carries, whatever the encoding of the message."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Callable
from contextlib import redirect_stderr
from types import SimpleNamespace
from typing import Any, Final, NamedTuple

from mcap.records import Channel, Schema

from roadeval.logs.container.records import LARGEST, Message
from roadeval.logs.container.source import Buffer
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.flatbuffer import flatbuffer_reader
from roadeval.logs.messages.layouts import cdr_reader, is_whole, layout_of, ros1_reader, stamp_of
from roadeval.logs.messages.pictures import Picture, nanoseconds, picture_in

_ZSTD: Final = b"\x28\xb5\x2f\xfd"


class Decoder(NamedTuple):
    """Reads the messages of a channel: the whole picture, or only its stamp in nanoseconds.

    Both raise `BadMessage` for a message that cannot be decoded.
    """

    picture: Callable[[Buffer], Picture]
    stamp: Callable[[Buffer], int]


def decoder_for(channel: Channel, schema: Schema | None) -> Decoder:
    """Return what decodes the messages of a channel.

    The `mcap` project's own decoders where they can, else the layout that the schema's name
    stands for.

    Raises
    ------
    BadMessage
        If nothing decodes them.
    """
    decode = _by_library(channel, schema) or _by_name(channel, schema)
    if decode is None:
        name = schema.encoding if schema else "no"
        raise BadMessage(
            f"{channel.message_encoding!r} messages with {name!r} schema are not readable"
        )

    def picture(data: Buffer) -> Picture:
        try:
            return picture_in(decode(_unpacked(channel, data)))
        except BadMessage:
            raise
        except Exception as error:  # the libraries raise whatever their parsers stumble on
            raise BadMessage(f"the message cannot be decoded: {_line(error)}") from error

    layout = layout_of(schema.name) if schema else None
    if layout is None or channel.message_encoding != "cdr":
        return Decoder(picture, lambda data: picture(data).stamp_ns)
    return Decoder(picture, lambda data: nanoseconds(stamp_of(layout, _unpacked(channel, data))))


def message_is_whole(channel: Channel, schema: Schema | None, message: Message) -> bool:
    """Whether a message is as long as its own fields say, as far as that can be told."""
    layout = layout_of(schema.name) if schema else None
    if layout and channel.message_encoding == "cdr":
        return is_whole(layout, message.data)
    try:
        decoder_for(channel, schema).picture(message.data)
    except BadMessage:
        return False
    return True


def _by_library(channel: Channel, schema: Schema | None) -> Callable[[Buffer], Any] | None:
    """Ask the libraries, with a new factory each time.

    They remember schemas by number alone, and numbers repeat from file to file.
    """
    from mcap_protobuf.decoder import DecoderFactory as Protobuf
    from mcap_ros1.decoder import DecoderFactory as Ros1
    from mcap_ros2.decoder import DecoderFactory as Ros2

    if schema is None or not schema.data:
        return None
    for factory in (Ros2(), Protobuf(), Ros1()):
        try:
            with redirect_stderr(io.StringIO()):  # the ROS parsers print what they stumble on
                decode = factory.decoder_for(channel.message_encoding, schema)
        except Exception:  # a schema can be wrong in any way; its name may still do
            continue
        if decode is not None:
            return lambda data, decode=decode: decode(bytes(data))  # type: ignore[misc]
    return None


def _by_name(channel: Channel, schema: Schema | None) -> Callable[[Buffer], Any] | None:
    if channel.message_encoding == "json":
        return _read_json
    layout = layout_of(schema.name) if schema else None
    if layout is None:
        return None
    readers = {"cdr": cdr_reader, "ros1": ros1_reader, "flatbuffer": flatbuffer_reader}
    make = readers.get(channel.message_encoding)
    return make(layout) if make else None


def _read_json(data: Buffer) -> SimpleNamespace:
    message: SimpleNamespace = json.loads(
        bytes(data), object_hook=lambda fields: SimpleNamespace(**fields)
    )
    if isinstance(message.data, str):
        message.data = base64.b64decode(message.data, validate=True)
    else:
        message.data = bytes(message.data)
    return message


def _unpacked(channel: Channel, data: Buffer) -> Buffer:
    """Undo rosbag2's compression message by message; CDR itself never begins like zstd."""
    if channel.message_encoding != "cdr" or bytes(data[:4]) != _ZSTD:
        return data
    import zstandard

    if not 0 <= zstandard.frame_content_size(data) <= LARGEST:
        raise BadMessage("a compressed message of a size that cannot be")
    message: bytes = zstandard.ZstdDecompressor().decompress(data)
    return message


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
