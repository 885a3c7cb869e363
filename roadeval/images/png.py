"""Decoding of usual PNG files, several times as fast as by Pillow.

Pillow holds Python's interpreter lock while it decodes a PNG, and the other worker threads wait.
Whatever else there is in a file, damage above all, is left to Pillow, which says what it is.

ISA-L unpacks them, which also packs the recordings: noisy images in half of zlib-ng's time, truths
of few classes in twice as long.

References
----------
"Portable Network Graphics (PNG) Specification (Third Edition)", W3C, 2025.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from isal import isal_zlib as zlib

from roadeval.images.limits import Limits
from roadeval.kernels import KERNELS, are_compiled

Chunks = list[tuple[bytes, memoryview]]
"""Name and body of each."""

_HEAD: Final = struct.Struct(">IIBBBBB")
"""Width, height, bits of a sample, kind of pixels; compression, filters and passes: 0 is usual."""
_SIGNATURE: Final = 8
"""Bytes before the first chunk."""
_GREY, _COLOUR, _PALETTE = 0, 2, 3
_CHANNELS: Final = {
    **dict.fromkeys([(_GREY, 8), (_GREY, 16), *((_PALETTE, bits) for bits in (1, 2, 4, 8))], 1),
    (_COLOUR, 8): 3,
}
"""By kind of pixels and bits of a sample."""
_INVALID: Final[type[Exception]] = zlib.error  # type: ignore[assignment]  # by its stub
_FILTERS: Final = 5
"""Kinds of them, by the first byte of a row."""
_ORDER: Final = re.compile(
    rb"IHDR(?:[a-z].{3})*(?:PLTE(?:[a-z].{3})*)?(?:IDAT)+(?:[a-z].{3})*IEND", re.DOTALL
)
"""The names of all chunks, one after the other. Those that begin with a small letter do not change
what a pixel's numbers are; `_ANIMATED` adds further images."""
_ANIMATED: Final = b"acTL"
_MOST_CHUNKS: Final = 1 << 16


@dataclass(frozen=True, slots=True, eq=False)
class Png:
    """A decoded file.

    Parameters
    ----------
    pixels
        ``(H, W)`` uint8 or uint16, or ``(H, W, 3)`` uint8 RGB.
    palette
        ``(n, 3)`` uint8 RGB: the colours of which the pixels are indices, if they are.
    """

    pixels: npt.NDArray[Any]
    palette: npt.NDArray[np.uint8] | None


def decode(data: bytes | memoryview, limits: Limits) -> Png | None:
    """Decode a PNG file of grey levels, of RGB, or with a palette; an `ImageError` if too large.

    Returns
    -------
    Png or None
        None if a part of the file is damaged, if it has a form that is not read here (rows in
        several passes, opacity of each pixel, grey of less than 8 bits, RGB of 16), and where the
        kernels are not compiled.
    """
    chunks = _chunks(memoryview(data)) if are_compiled() else None
    if chunks is None:
        return None
    width, height, bits, kind, *methods = _HEAD.unpack(chunks[0][1])
    channels = _CHANNELS.get((kind, bits))
    if channels is None or any(methods):
        return None
    limits.check(width, height)
    lines = _lines(_joined(chunks, b"IDAT"), height, -(-width * channels * bits // 8))
    if lines is None:
        return None
    rows = KERNELS.unfilter_rows(lines, max(1, channels * bits // 8))
    if kind == _PALETTE:
        return _indexed(_unpacked(rows, bits, width), _joined(chunks, b"PLTE"))
    if bits == 16:
        return Png(rows.view(">u2").astype(np.uint16), None)
    return Png(rows.reshape(height, width, 3) if channels == 3 else rows, None)


def _indexed(indices: npt.NDArray[np.uint8], colours: bytes) -> Png | None:
    """Return ``(H, W)`` indices with their palette, if it has a colour for each."""
    if len(colours) % 3 or 3 * int(indices.max()) >= len(colours):
        return None
    return Png(indices, np.frombuffer(colours, np.uint8).reshape(-1, 3))


def _joined(chunks: Chunks, name: bytes) -> bytes:
    return b"".join(body for each, body in chunks if each == name)


def _chunks(data: memoryview) -> Chunks | None:
    """Return names and bodies of a file's chunks, if all are whole and in order."""
    found: Chunks = []
    place = _SIGNATURE
    while len(data) - place >= 12 and len(found) < _MOST_CHUNKS:
        (size,) = struct.unpack_from(">I", data, place)
        inner = data[place + 4 : place + 8 + size]
        place += 12 + size
        if place > len(data) or struct.unpack_from(">I", data, place - 4) != (zlib.crc32(inner),):
            return None
        found.append((bytes(inner[:4]), inner[4:]))
    names = [name for name, _ in found]
    if place < len(data) or _ANIMATED in names or not _ORDER.fullmatch(b"".join(names)):
        return None
    return found if len(found[0][1]) == _HEAD.size else None


def _lines(packed: bytes, height: int, size: int) -> npt.NDArray[np.uint8] | None:
    """Return ``(H, 1 + B)`` filtered rows of so many bytes, if these are what was packed.

    ISA-L reads a few streams that zlib refuses, by their codes: their sums must hold all the same.
    """
    if packed[:1] > b"\x7f":  # a window that zlib does not have, which ISA-L overlooks
        return None
    stream, expected = zlib.decompressobj(), height * (1 + size)
    try:
        lines = np.frombuffer(stream.decompress(packed, expected + 1), np.uint8)
    except _INVALID:
        return None
    if len(lines) != expected or not stream.eof or stream.unused_data:
        return None
    lines = lines.reshape(height, 1 + size)
    return lines if lines[:, 0].max() < _FILTERS else None


def _unpacked(rows: npt.NDArray[np.uint8], bits: int, width: int) -> npt.NDArray[np.uint8]:
    """Return the ``(H, W)`` samples of so many bits; the leftmost is in a byte's highest bits."""
    if bits == 8:
        return rows
    if bits == 1:
        return np.unpackbits(rows, axis=1, count=width)
    shifts = np.arange(8 - bits, -1, -bits, dtype=np.uint8)
    samples = rows[..., None] >> shifts & np.uint8((1 << bits) - 1)
    return np.ascontiguousarray(samples.reshape(len(rows), -1)[:, :width])
