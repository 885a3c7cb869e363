"""Messages and images: whatever the bytes, an image comes of them, or one reason why not."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from typing import NamedTuple

import numpy as np
from mcap.records import Channel, Schema

from roadeval.images.formats import Limits
from roadeval.logs.container.records import Message
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pictures import (
    CompressedPicture,
    Decoder,
    Picture,
    RawPicture,
    codec_of,
    decoder_for,
    message_stamp,
)
from roadeval.logs.messages.pixels import FORMATS, to_labels, to_rgb
from tests.fixtures.flavours import FLAVOURS, NoEncoderError, file_of, scenes
from tests.fuzz.changes import Choices
from tests.fuzz.harness import Harness

FILE, RAW = b"\xff", b"\xfe"
"""The first byte of a case that is a file, or raw pixels."""


class Kind(NamedTuple):
    """A kind of message: what describes and decodes it, and one that is sound."""

    channel: Channel
    schema: Schema | None
    decoder: Decoder
    sound: bytes


def check(data: bytes) -> None:
    """Decode a file, raw pixels, or a message of a kind, as the first byte chooses."""
    chosen, data = data[:1], data[1:]
    if chosen == FILE:
        _decode(CompressedPicture(0, "", memoryview(data)))
    elif chosen == RAW:
        _decode(raw(Choices(data)))
    else:
        kind = kinds()[sum(chosen) % len(kinds())]
        message_stamp(kind.channel, kind.schema, Message(1, 0, 0, 0, memoryview(data)))
        with suppress(BadMessage):
            kind.decoder.stamp(data)
        with suppress(BadMessage):
            _decode(kind.decoder.picture(data))


def raw(choices: Choices) -> RawPicture:
    """Return pixels of a small size, whose fields may contradict each other."""
    width, height, encoding = choices.number(40), choices.number(40), choices.of(sorted(FORMATS))
    step = choices.of((0, 8 * width, choices.number(400)))
    data = memoryview(bytes(choices.of((8 * width * height, choices.number(20_000)))))
    return RawPicture(0, width, height, encoding, step, bool(choices.number(2)), data)


def _decode(picture: Picture) -> None:
    codec_of(picture)
    limits = Limits()
    for decode in (to_rgb, to_labels):
        with suppress(BadMessage):
            array = decode(picture, limits)
            assert array.size
            has_sign = decode is to_labels and array.dtype.kind == "i"
            assert has_sign or array.dtype in (np.uint8, np.uint16)


@cache
def kinds() -> list[Kind]:
    """Return every kind of message that the fixtures know."""
    found = []
    for flavour in FLAVOURS.values():
        with suppress(NoEncoderError):
            log = flavour.log()
            (topic,) = log.topics
            channel = Channel(1, topic.name, topic.encoding, {}, 1)
            name, language, text = topic.schema or ("", "", b"")
            schema = Schema(1, text, language, name) if topic.schema else None
            decoder = decoder_for(channel, schema)
            found.append(Kind(channel, schema, decoder, log.messages[0].data))
    return found


def seeds() -> list[bytes]:
    """Return a message of each kind, and image files."""
    messages = [bytes([number]) + kind.sound for number, kind in enumerate(kinds())]
    image, grey = scenes()[0], scenes()[0][..., 0]
    files = [file_of(suffix, image) for suffix in (".jpg", ".png", ".webp", ".tiff", ".bmp")]
    files += [file_of(suffix, grey) for suffix in (".png", ".jpg")]
    pixels = [bytes((6, 0, 4, 0, 7 * n, 0)) + bytes(40) for n in range(len(FORMATS))]
    return [*messages, *(FILE + data for data in files), *(RAW + data for data in pixels)]


HARNESS = Harness(check, seeds, quick=1000)
