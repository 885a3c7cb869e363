"""Video in a log: frames that need the frames before them."""

from __future__ import annotations

import re
from contextlib import suppress
from typing import Any, Final, Protocol

from roadeval.images import ImageError, Limits
from roadeval.logs.errors import BadMessage, FrameError
from roadeval.logs.messages.pictures import CompressedPicture, DecodedPicture, Picture, codec_of

PATIENCE: Final = 16
"""Packets to feed beyond a frame before it counts as not decodable."""
FARTHEST_KEY: Final = 3000
"""Packets to look back for a keyframe."""
_DECODERS: Final = {"av1": "libdav1d"}
"""Where the codec's own name is not a decoder that every machine can run."""
_PARAMETERS: Final = {
    "h264": re.compile(rb"\x00\x00\x01[\x07\x27\x47\x67]"),
    "hevc": re.compile(rb"\x00\x00\x01[\x42\x43]"),
}
"""Heads of sequence parameters, which some encoders send in a packet of their own."""


class PictureSequence(Protocol):
    """The pictures of a topic, by position."""

    def __len__(self) -> int: ...

    def picture(self, position: int) -> Picture:
        """Read a picture, or raise `FrameError`."""
        ...


class Video:
    """The frames of a video topic, by position; fastest one after the other.

    A frame that is larger than the limits allow is not decoded.
    """

    def __init__(self, packets: PictureSequence, limits: Limits) -> None:
        import av

        self._av: Final = av
        self._packets = packets
        self._limits = limits
        self._decoder: Any = None
        self._next = 0
        self._broken = ""
        self._damaged = False
        self._waiting: dict[int, Picture] = {}
        self._ready: dict[int, DecodedPicture | FrameError] = {}

    def __len__(self) -> int:
        return len(self._packets)

    def picture(self, position: int) -> DecodedPicture:
        """Decode a frame, from the keyframe before it if need be.

        A `FrameError` if it, or one that it builds upon, cannot be decoded.
        """
        if position not in self._ready:
            self._go_to(position)
        last = min(position + PATIENCE, len(self._packets) - 1)
        while position not in self._ready and self._next <= last:
            self._feed(self._next)
            self._next += 1
        if position not in self._ready and self._next == len(self._packets):
            with suppress(BadMessage):
                self._drain(None)
            self._decoder = None
        found = self._ready.pop(position, None)
        self._ready = {ready: late for ready, late in self._ready.items() if ready > position}
        if found is None:
            raise FrameError("the decoder gave no picture for it")
        if isinstance(found, FrameError):
            raise found
        return found

    def _go_to(self, position: int) -> None:
        """Begin at the keyframe before a position, unless decoding on gets there sooner."""
        if self._next <= position <= self._next + PATIENCE:
            return
        keyframe = self._keyframe(position)
        if position < self._next or keyframe > self._next:
            self._decoder, self._waiting, self._ready = None, {}, {}
            self._next, self._broken, self._damaged = keyframe, "", False

    def _keyframe(self, position: int) -> int:
        """Position of the last keyframe at or before ``position``."""
        for candidate in range(position, max(position - FARTHEST_KEY, -1), -1):
            try:
                packet = self._packets.picture(candidate)
            except FrameError:
                continue
            if is_keyframe(packet):
                return candidate
        return position

    def _feed(self, position: int) -> None:
        try:
            packet = self._packets.picture(position)
        except FrameError as error:
            self._broken = "a frame that it builds upon is lost"
            self._ready[position] = error
            return
        if is_keyframe(packet):
            self._broken = ""
        elif self._decoder is None:
            self._broken = "the video has no keyframe before it"
        if self._broken:
            self._ready[position] = FrameError(self._broken)
            return
        try:
            self._decode(position, packet)
        except BadMessage as error:
            self._ready[position] = FrameError(str(error))
            self._broken = "a frame that it builds upon is lost"

    def _decode(self, position: int, packet: Picture) -> None:
        codec = codec_of(packet)
        if self._decoder is None:
            if codec is None:
                raise BadMessage("its video codec is unknown")
            self._decoder = self._av.CodecContext.create(_DECODERS.get(codec, codec), "r")
            self._decoder.thread_count = 1
            self._decoder.options = {"max_pixels": str(self._limits.max_pixels)}
        self._waiting[position] = packet
        unit = self._av.Packet(bytes(packet.data))
        unit.pts = unit.dts = position
        self._drain(unit)

    def _drain(self, unit: Any) -> None:
        if self._decoder is None:
            return
        try:
            frames = self._decoder.decode(unit)
        except self._av.FFmpegError as error:
            raise BadMessage(self._reason(error)) from error
        for frame in frames:
            damage = self._damage_of(frame)
            packet = self._waiting.pop(frame.pts, None)
            if packet is not None:
                pixels = frame.to_ndarray(format="rgb24")
                found = DecodedPicture(packet.stamp_ns, packet.data, pixels, damage)
                self._ready[frame.pts] = found

    def _reason(self, error: Any) -> str:
        """Return why a packet cannot be decoded: its size, where the decoder tells it."""
        reason = f"its video cannot be decoded: {error.strerror}"
        if not (self._decoder.width and self._decoder.height):
            most = f"{self._limits.max_pixels} pixels that `frames.max_pixels` allows"
            return f"{reason}, or it has more than the {most}"
        try:
            self._limits.check(self._decoder.width, self._decoder.height)
        except ImageError as too_large:
            return str(too_large)
        return reason

    def _damage_of(self, frame: Any) -> str:
        """Return what is wrong with a frame, in which the decoder has filled in what is damaged."""
        if frame.is_corrupt:
            self._damaged = True
            return "its video is damaged"
        self._damaged &= not frame.key_frame
        return "a frame that it builds upon is damaged" if self._damaged else ""


def is_keyframe(packet: Picture) -> bool:
    """Whether decoding can begin with this packet: a keyframe, or parameters in front of one."""
    codec = codec_of(packet)
    if not isinstance(packet, CompressedPicture) or codec is None:
        return False
    import av

    data = bytes(packet.data)
    if codec in _PARAMETERS and _PARAMETERS[codec].search(data):
        return True
    parser = av.CodecContext.create(codec, "r")
    return any(part.is_keyframe for part in (*parser.parse(data), *parser.parse(None)))
