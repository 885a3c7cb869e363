"""Pictures in messages: raw pixels, image files, and frames of a video.

A decoder makes a picture from the bytes of a message in any encoding. Frames of a video depend on
the frames before them.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from itertools import chain, pairwise
from typing import Any, Final, Protocol

import numpy as np
from mcap.records import Channel, Schema

from roadeval.data import Rgb
from roadeval.images.decoding import ORIENTATIONS, upright
from roadeval.images.formats import ImageError, Limits
from roadeval.logs.container.records import LARGEST, Buffer, Message
from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.messages import encodings
from roadeval.logs.messages.encoding import KINDS, Encoding, MessageReader, TopicKind, parts_of
from roadeval.logs.messages.frame_numbers import FrameNumbers
from roadeval.logs.settings import parse_time
from roadeval.runtime.discovery import collect
from roadeval.runtime.sentence import Sentence


@dataclass(frozen=True, eq=False)
class RawPicture:
    """Raw pixels: ``height`` rows of ``step`` bytes (0 if not stated) in ``encoding``."""

    stamp_ns: int
    width: int
    height: int
    encoding: str
    step: int
    big_endian: bool
    data: Buffer
    frame_id: str = ""
    """The camera's name in the header."""


@dataclass(frozen=True, eq=False)
class CompressedPicture:
    """An image file or a packet of a video; ``format`` is what the message states."""

    stamp_ns: int
    format: str
    data: Buffer
    frame_id: str = ""
    number: int | None = None
    """A packet's number, by its encoder or its recorder."""


@dataclass(frozen=True, eq=False)
class DecodedPicture:
    """A decoded frame of a video; ``data`` is its packet."""

    stamp_ns: int
    data: Buffer
    pixels: Rgb
    turned: int = 1
    """Its orientation, as EXIF counts it; the pixels are turned already if the limits say so."""


LoggedPicture = RawPicture | CompressedPicture
Picture = LoggedPicture | DecodedPicture

_BUFFERS: Final = (bytes, bytearray, memoryview)
_CODECS: Final = {
    **dict.fromkeys(("h264", "avc", "libx264"), "h264"),
    **dict.fromkeys(("h265", "hevc", "libx265"), "hevc"),
    "vp9": "vp9",
    **dict.fromkeys(("av1", "libsvtav1", "librav1e"), "av1"),
}


def codec_of(picture: Picture) -> str | None:
    """Return the video codec of a packet; None for any other picture."""
    if not isinstance(picture, CompressedPicture):
        return None
    for word in re.split(r"[^a-z0-9]+", picture.format.lower()):
        if word in _CODECS:
            return _CODECS[word]
    start_codes = (b"\x00\x00\x00\x01", b"\x00\x00\x01")
    return "h264" if bytes(picture.data[:4]).startswith(start_codes) else None


def picture_in(message: Any) -> LoggedPicture:
    """Return the picture in the fields of a message; a `BadMessage` if it lacks some."""
    try:
        stamp_ns, header = 0, getattr(message, "header", message)
        if header is not message:
            stamp_ns = nanoseconds(header.stamp)
        elif hasattr(message, "timestamp"):
            stamp_ns = nanoseconds(message.timestamp)
        frame_id = getattr(header, "frame_id", "")
        frame_id = frame_id if isinstance(frame_id, str) else ""
        if not hasattr(message, "height") or hasattr(message, "pts"):
            name = _name(message.format if hasattr(message, "format") else message.encoding)
            data = _checked(_BUFFERS, message.data)
            if name.lower() == "zstd":
                return _unpack_zstd(stamp_ns, bytes(data), frame_id)
            pts = int(message.pts) if hasattr(message, "pts") else None
            return CompressedPicture(stamp_ns, name, data, frame_id, pts)
        size, encoding = (int(message.width), int(message.height)), _name(message.encoding)
        step, order = int(getattr(message, "step", 0)), getattr(message, "is_bigendian", False)
        data = _checked(_BUFFERS, message.data)
        return RawPicture(stamp_ns, *size, encoding, step, bool(order), data, frame_id)
    except (AttributeError, IndexError, TypeError, ValueError, LogError) as error:
        raise BadMessage("it lacks the fields of an image") from error


_PACKED: Final = struct.Struct("<IIBII")
"""Height, width, whether the upper byte comes first, bytes a row, length of the encoding."""


def _unpack_zstd(stamp_ns: int, data: bytes, frame_id: str) -> RawPicture:
    """Return the raw image in a message of image_transport's ``zstd``, which used to be gzip."""
    import zstandard

    try:
        height, width, order, step, letters = _PACKED.unpack_from(data)
        begin = _PACKED.size + letters
        packed, most = data[begin:], max(min(4 * step * height, LARGEST), 1)
        if packed.startswith(b"\x1f\x8b"):  # gzip
            pixels = zlib.decompressobj(zlib.MAX_WBITS | 16).decompress(packed, most)
        elif zstandard.frame_content_size(packed) <= most:
            pixels = zstandard.ZstdDecompressor().decompress(packed, most)
        else:
            raise BadMessage("an image in zstd of another size than it says")
    except (struct.error, zlib.error, zstandard.ZstdError) as error:
        raise BadMessage("an image in zstd that cannot be uncompressed") from error
    encoding = _name(data[_PACKED.size : begin].decode("ascii", "replace"))
    return RawPicture(stamp_ns, width, height, encoding, step, bool(order), pixels, frame_id)


def _name(text: Any) -> str:
    """Return the name of an encoding, which some writers pad with zeros or blanks."""
    return str(_checked(str, text)).strip("\0 \t\r\n")


def _checked(kind: type | tuple[type, ...], value: Any) -> Any:
    """Return a value; a TypeError if a damaged schema gives it another type."""
    if not isinstance(value, kind):
        raise TypeError(value)
    return value


def nanoseconds(stamp: Any) -> int:
    """Return the nanoseconds of a stamp in any of its forms, exactly."""
    if isinstance(stamp, str):
        return parse_time(stamp)
    units = ("sec", "secs", "seconds"), ("nanosec", "nsec", "nsecs", "nanos", "nanoseconds")
    seconds, nanos = ([getattr(stamp, n) for n in names if hasattr(stamp, n)] for names in units)
    return int(seconds[0]) * 1_000_000_000 + int(nanos[0] if nanos else 0)


@dataclass(frozen=True)
class Decoder:
    """Reads the messages of a channel; a `BadMessage` for one that cannot be decoded."""

    reader: MessageReader

    def fields(self, data: Buffer) -> Any:
        """Return a message of any kind with its fields as attributes."""
        with _one_error():
            return self.reader.decode(data)

    def picture(self, data: Buffer) -> LoggedPicture:
        """Return the picture in a message."""
        with _one_error():
            return picture_in(self.reader.decode(data))

    def stamp(self, data: Buffer) -> int:
        """Return the stamp of a message in nanoseconds."""
        if self.reader.stamp is None:
            return self.picture(data).stamp_ns
        with _one_error():
            return nanoseconds(self.reader.stamp(data))


@cache
def message_encodings() -> Mapping[str, Encoding]:
    """Return the message encodings of the folder, by name."""
    return {encoding.name: encoding for encoding in chain(*collect(encodings, "ENCODINGS"))}


def kind_of(channel: Channel, schema: Schema | None) -> TopicKind:
    """Return the kind of a channel by its schema's name.

    Transforms that are not static are of no use here, and too many to be indexed.
    """
    if schema is None:
        encoding = message_encodings().get(channel.message_encoding)
        return encoding.without_schema if encoding else TopicKind.OTHER
    kind = KINDS.get((parts_of(schema.name) or [""])[-1], TopicKind.OTHER)
    moves = kind is TopicKind.TRANSFORMS and not channel.topic.endswith("static")
    return TopicKind.OTHER if moves else kind


def decoder_for(channel: Channel, schema: Schema | None) -> Decoder:
    """Return the decoder of a channel's messages; a `BadMessage` if there is none."""
    parts = () if schema is None else (schema.name, schema.encoding, schema.data)
    decoder = _cached_decoder(channel.message_encoding, *parts)
    if decoder is None:
        messages, name = channel.message_encoding, schema.encoding if schema else "no"
        raise BadMessage(f"{messages!r} messages with {name!r} schema are not readable")
    return decoder


def message_stamp(channel: Channel, schema: Schema | None, message: Message) -> int | None:
    """Return a message's stamp; None if its fields contradict its length or cannot be read."""
    with suppress(BadMessage):
        decoder = decoder_for(channel, schema)
        if decoder.reader.is_whole(message.data):
            return decoder.picture(message.data).stamp_ns
    return None


@lru_cache(maxsize=64)
def _cached_decoder(message_encoding: str, *parts: Any) -> Decoder | None:
    """Return the decoder of a schema's messages, which channels and files share."""
    encoding = message_encodings().get(message_encoding)
    schema = Schema(1, name=parts[0], encoding=parts[1], data=parts[2]) if parts else None
    reader = encoding.reader(schema) if encoding else None
    return Decoder(reader) if reader else None


@contextmanager
def _one_error() -> Iterator[None]:
    """Turn the exceptions of the libraries' parsers into a `BadMessage`."""
    try:
        yield
    except BadMessage:
        raise
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BadMessage(f"the message cannot be decoded: {reason}") from error


PATIENCE: Final = 16
"""Packets that are decoded beyond a frame before it counts as undecodable."""
LOST: Final = "a frame that it builds upon is lost"
_DECODERS: Final = {"av1": "libdav1d"}
"""Decoders that run on every machine, if the codec's own decoder does not."""
_PARAMETERS: Final = {
    "h264": re.compile(rb"\x00\x00\x01[\x07\x27\x47\x67]"),
    "hevc": re.compile(rb"\x00\x00\x01[\x42\x43]"),
}
"""Heads of sequence parameters, which some encoders send in a separate packet."""
_PARAMETER_UNITS: Final = {
    "h264": re.compile(
        rb"\x00\x00\x01[\x07\x08\x27\x28\x47\x48\x67\x68].*?(?=\x00\x00\x01|\Z)", re.DOTALL
    ),
    "hevc": re.compile(rb"\x00\x00\x01[\x40-\x45].*?(?=\x00\x00\x01|\Z)", re.DOTALL),
}
"""All parameters, which some encoders send once, at the beginning."""
_NO_SLICES: Final = {
    "h264": frozenset(kind | rank << 5 for kind in range(6, 14) for rank in range(4)),
    "hevc": frozenset(range(32 << 1, 41 << 1)),
}
"""First bytes of units without a picture: parameters, delimiters, messages and ends."""


class PictureSequence(Protocol):
    """The pictures of a topic, by position."""

    def __len__(self) -> int: ...

    def picture(self, position: int) -> Picture:
        """Read a picture, or raise `FrameError`."""
        ...


class Video:
    """The frames of a video topic by position; to read them in their order is fastest.

    Frames beyond the limits are not decoded.
    """

    def __init__(self, packets: PictureSequence, limits: Limits) -> None:
        import av

        self._av: Final = av
        self._packets, self._limits = packets, limits
        self.notes: Final = dict[str, str]()
        """Warnings about the frames so far, by their kind."""
        self._ready: dict[int, DecodedPicture | FrameError]
        self._begin(0)

    def __len__(self) -> int:
        return len(self._packets)

    def picture(self, position: int) -> DecodedPicture:
        """Decode a frame, from the keyframe before it if necessary.

        A `FrameError` if it, or a frame that it depends on, cannot be decoded.
        """
        is_near = position in self._waiting or 0 <= position - self._next <= PATIENCE
        if position not in self._ready and not is_near:
            keyframe = self.keyframe(position)
            if position < self._next or keyframe > self._next:
                self._begin(keyframe)
        self._advance(position)
        if position not in self._ready and 0 < self._first == self.keyframe(position):
            # Frames of an open group, or of an intra refresh, build upon the group before.
            self._begin(self.keyframe(self._first - 1))
            self._advance(position)
        frame = self._ready.pop(position, FrameError("the decoder gave no picture for it"))
        self._ready = {at: outcome for at, outcome in self._ready.items() if at > position}
        if isinstance(frame, FrameError):
            raise frame
        return frame

    def _begin(self, position: int) -> None:
        self._first = self._next = position
        self._damaged, self._ready, self._waiting = False, {}, dict[int, Picture]()
        self._shown, self._steps = (position, 0), self._decode(position)

    def _advance(self, position: int) -> None:
        """Decode until a frame is ready, or the decoder will not give it any more."""
        while position not in self._ready and self._next <= position + PATIENCE:
            if not next(self._steps, False):
                break

    def keyframe(self, position: int) -> int:
        """Return the position of the last keyframe at or before ``position``."""
        for candidate in range(position, max(position - 3000, -1), -1):
            with suppress(FrameError):
                if is_keyframe(self._packets.picture(candidate)):
                    return candidate
        return position

    def parameters(self, position: int) -> tuple[int, bytes]:
        """Return the place of a keyframe's parameters, and the parameters that it lacks there."""
        codec, units = codec_of(self._packets.picture(position)), b""
        near = range(position, max(position - 3000, -1), -1)
        for candidate in chain(near, range(min(PATIENCE, position), -1, -1)):
            if codec not in _PARAMETERS:
                break
            with suppress(FrameError):
                data = bytes(self._packets.picture(candidate).data)
                units = b"".join(_PARAMETER_UNITS[codec].findall(data)) + units
                if _PARAMETERS[codec].search(data):
                    return candidate, units if candidate < position else b""
        return position, b""

    @cached_property
    def _counted(self) -> bool:
        """Whether the packets are numbered one by one, as the first ones show."""
        first = list[Picture]()
        for position in range(min(PATIENCE, len(self._packets))):
            with suppress(FrameError):
                first.append(self._packets.picture(position))
        steps = [_step(*pair) for pair in pairwise(first)]
        return 4 * steps.count(1) >= 3 * len(steps) > 0

    def _follows(self, packet: Picture, last: Picture | None, numbers: FrameNumbers) -> bool:
        """Return False if a packet that this one depends on is known to be lost."""
        is_gap = codec_of(packet) == "h264" and numbers.is_gap(bytes(packet.data))
        if numbers.are_counted or last is None:
            return not is_gap
        return not (self._counted and _step(last, packet) > 1)

    def _decode(self, begin: int) -> Iterator[bool]:
        """Decode from a keyframe on, one packet at each step; the frames go to ``_ready``."""
        decoder: Any = None
        last, numbers, broken = None, FrameNumbers(), ""
        for position in range(begin, len(self._packets)):
            self._next = position + 1
            try:
                packet = self._packets.picture(position)
                follows, last = self._follows(packet, last, numbers), packet
                if is_keyframe(packet):
                    if broken or not follows:
                        # Frames of an open group may build upon lost ones before the keyframe.
                        self._empty(decoder)
                        decoder = None
                    broken = ""
                elif decoder is None:
                    broken = "the video has no keyframe before it"
                elif not follows:
                    broken = broken or LOST
                if broken:
                    raise FrameError(broken)
                data = bytes(packet.data)
                if not data:  # it would end the decoder; the next frames tell if they need it
                    shows_loss = numbers.are_counted or codec_of(packet) == "hevc"
                    broken = "" if shows_loss and decoder is not None else LOST
                    self._ready[position] = FrameError("a packet without data")
                    yield True
                    continue
                if decoder is None:
                    decoder, data = self._decoder(packet), self.parameters(position)[1] + data
                    numbers.is_gap(data)
                self._waiting[position] = packet
                unit = self._av.Packet(data)
                unit.pts = unit.dts = position
                self._take(decoder, unit)
            except (BadMessage, FrameError) as error:
                self._ready[position] = FrameError.of(error)
                broken = broken or LOST
            yield True
        self._empty(decoder)
        yield True

    def _decoder(self, packet: Picture) -> Any:
        codec = codec_of(packet)
        if codec is None:
            raise BadMessage("its video codec is unknown")
        decoder = self._av.CodecContext.create(_DECODERS.get(codec, codec), "r")
        decoder.thread_count = 1
        decoder.options = {"max_pixels": str(self._limits.max_pixels)}
        return decoder

    def _empty(self, decoder: Any) -> None:
        """Take the frames that are left in a decoder, if there is one."""
        with suppress(BadMessage):
            if decoder is not None:
                self._take(decoder, None)

    def _take(self, decoder: Any, unit: Any) -> None:
        """Decode a packet, or the end of the video, and take the frames that come out."""
        try:
            frames = decoder.decode(unit)
        except self._av.FFmpegError as error:
            raise BadMessage(self._reason(decoder, error)) from error
        for frame in frames:
            # The decoder fills in damaged parts.
            self._damaged = frame.is_corrupt or (self._damaged and not frame.key_frame)
            packet = self._waiting.pop(frame.pts, None)
            if packet is not None and self._damaged:
                what = "its video" if frame.is_corrupt else "a frame that it builds upon"
                self._ready[frame.pts] = FrameError(f"{what} is damaged")
            elif packet is not None:
                self._look(frame, packet)
                full = self._av.video.reformatter.ColorRange.JPEG
                luma_range = {"src_color_range": full} if self._limits.full_range else {}
                pixels, turned = frame.to_ndarray(format="rgb24", **luma_range), turn_of(frame)
                pixels = upright(pixels, turned if self._limits.turn else 1)
                picture = DecodedPicture(packet.stamp_ns, packet.data, pixels, turned)
                self._ready[frame.pts] = picture

    def _look(self, frame: Any, packet: Picture) -> None:
        """Note doubts about a frame; frames come in the order in which they are shown."""
        last, stamp = self._shown
        self._shown = frame.pts, packet.stamp_ns
        if frame.pts < last:
            self.notes["order"] = (
                "the video has B-frames, and stamps in the order of decoding: frames bear stamps "
                "and numbers of others near by; record it without B-frames"
                if packet.stamp_ns <= stamp
                else "the video has B-frames: frames are numbered in the order of decoding, and "
                "labels that are paired by number in the order of stamps, in which it is shown"
            )
        form, plane = frame.format, frame.planes[0]
        is_limited = not frame.color_range and not self._limits.full_range
        if not (is_limited and form.name.startswith("yuv4") and form.components[0].bits == 8):
            return
        luma = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)[::4, : frame.width : 4]
        share = ((luma < 16) | (luma > 235)).mean()
        if share > 0.02:  # compression explains less
            self.notes.setdefault(
                "range",
                Sentence(
                    "{} % of the luma of frame {} lies beyond 16 to 235, and the video does not "
                    "say which range it has: if it is the full one, as of converted JPEGs, set "
                    "{frames.full_range}",
                    f"{100 * share:.0f}",
                    frame.pts,
                ),
            )

    def _reason(self, decoder: Any, error: Any) -> str:
        """Return why a packet cannot be decoded: its size, if the decoder knows it."""
        reason = f"its video cannot be decoded: {error.strerror}"
        if not (decoder.width and decoder.height):
            most = "{}, or it has more than the {} pixels that {frames.max_pixels} allows"
            return Sentence(most, reason, self._limits.max_pixels)
        try:
            self._limits.check(decoder.width, decoder.height)
        except ImageError as too_large:
            return too_large.sentence
        return reason


def _step(one: Picture, other: Picture) -> int:
    """Return the difference between the numbers of two packets; 0 if one has none."""
    first, second = (getattr(packet, "number", None) for packet in (one, other))
    return 0 if first is None or second is None else second - first


def turn_of(frame: Any) -> int:
    """Return the orientation of a frame of PyAV by its display matrix, as EXIF counts it."""
    matrix = frame.side_data.get("DISPLAYMATRIX")
    if matrix is None:
        return 1
    a, b, _, c, d = struct.unpack("=5i", bytes(matrix)[:20])
    exchanged = abs(b) > abs(a)
    signs = (b < 0, c < 0) if exchanged else (d < 0, a < 0)
    return next(n for n, turn in ORIENTATIONS.items() if turn == (exchanged, *signs))


def has_no_picture(packet: Picture) -> bool:
    """Return whether a packet of a video holds nothing but parameters and the like."""
    kinds = _NO_SLICES.get(codec_of(packet) or "", frozenset[int]())
    data = bytes(packet.data) if kinds else b""
    units = re.finditer(b"\0\0\1(.)", data, re.DOTALL)
    are_others = (unit[1][0] in kinds for unit in units)
    return next(are_others, False) and all(are_others)


def is_keyframe(packet: Picture) -> bool:
    """Return whether decoding can begin here: at a keyframe, or parameters in front of one."""
    codec = codec_of(packet)
    if not isinstance(packet, CompressedPicture) or codec is None:
        return False
    import av

    data = bytes(packet.data)
    if codec in _PARAMETERS and _PARAMETERS[codec].search(data):
        return True
    parser = av.CodecContext.create(codec, "r")
    return any(part.is_keyframe for part in (*parser.parse(data), *parser.parse(None)))
