"""The size of a video's frames, for decoders that refuse large ones without telling it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Final

_SYNC: Final = f"{0x498342:024b}"
"""Bits in the head of every VP9 keyframe."""
_HEAD: Final = 16
"""Bytes that hold the size, wherever it lies."""


def size_in(av: Any, codec: str, data: bytes) -> tuple[int, int] | None:
    """Return width and height as a packet states them; None if it does not, or is not understood.

    ``av`` is PyAV.
    """
    stated = _SIZES.get(codec)
    return stated(av, data) if stated else None


def _of_vp9(_av: Any, data: bytes) -> tuple[int, int] | None:
    """Read the head of a keyframe (6.2 of the VP9 bitstream specification)."""
    bits = f"{int.from_bytes(data[:_HEAD].ljust(_HEAD), 'big'):0{8 * _HEAD}b}"
    profile = int(bits[3] + bits[2], 2)
    at = 8 + (profile == 3)
    if bits[at : at + len(_SYNC)] != _SYNC:
        return None
    at += len(_SYNC) + (profile >= 2)
    is_rgb = bits[at : at + 3] == "111"
    at += 3 if is_rgb else 4
    if profile % 2:
        at += 1 if is_rgb else 3
    width, height = int(bits[at : at + 16], 2), int(bits[at + 16 : at + 32], 2)
    return width + 1, height + 1


def _of_av1(av: Any, data: bytes) -> tuple[int, int] | None:
    """Let FFmpeg's own decoder read the head: without a graphics card it decodes nothing."""
    head = av.CodecContext.create("av1", "r")
    with suppress(av.FFmpegError):
        head.decode(av.Packet(data))
    return (head.width, head.height) if head.width and head.height else None


_SIZES: Final[Mapping[str, Callable[[Any, bytes], tuple[int, int] | None]]] = {
    "vp9": _of_vp9,
    "av1": _of_av1,
}
