"""PNG files: label images with a palette, maps of grey levels, and colour images.

A label image has 1, 2, 4 or 8 bits a pixel: the value of a pixel is its index, the palette only
colours it. A binary mask of a real frame takes a quarter of what its raw bytes take after LZ4.

Pillow and OpenCV take several times as long to encode them. zlib-ng finds the same runs as zlib, in
half the time.

References
----------
"Portable Network Graphics (PNG) Specification (Third Edition)", W3C, 2025, sections 5, 9 and 11.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from enum import IntEnum
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt
from zlib_ng import zlib_ng as zlib

from roadeval.data.colours import ColourWithOpacity
from roadeval.data.packed import Packed
from roadeval.kernels import KERNELS

Bytes = npt.NDArray[np.uint8]

_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_GREY, _COLOUR, _PALETTE = 0, 2, 3
"""The kinds of pixels, as a file's head names them."""


class Filter(IntEnum):
    """Filters of a row: what is subtracted from each byte, by their numbers in the file."""

    LEFT = 1
    """The byte of the pixel to the left: for few levels in wide areas."""
    ABOVE = 2
    """The byte above: most of a mask is as the row above it, and runs of zeros are left."""
    MEAN = 3
    """The mean of both, rounded down: for noise, of which it takes over the least."""


_REVERSED: Final = np.packbits(
    np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1, bitorder="little"), axis=1
).ravel()
"""Each byte with its bits the other way round."""

_GATHERED: Final = {
    2: ("<u4", 1 << 30 | 1 << 20 | 1 << 10 | 1, 24),
    4: ("<u2", 1 << 12 | 1, 8),
}
"""How the labels of a byte, one in each byte of a little-endian word, come together in its highest
byte: by a product, whose terms are the labels at their places, others below or beyond the word."""


def encode_labels(labels: Bytes | Packed, palette: Sequence[ColourWithOpacity]) -> bytes:
    """Encode ``(H, W)`` uint8 labels, each below ``len(palette)``, as a PNG file.

    Labels of two classes may be packed.
    """
    bits = _bits(len(palette))
    if isinstance(labels, Packed):
        rows = _reversed(labels) if bits == 1 else _pack(labels.pixels(), bits)
    else:
        rows = _pack(labels, bits)
    colours = bytes(value for *rgb, _ in palette for value in rgb)
    opacity = bytes(alpha for *_, alpha in palette)
    chunks = _chunk(b"PLTE", colours), _chunk(b"tRNS", opacity)
    return _file(labels.shape, bits, _PALETTE, chunks, _filtered(rows, 1, Filter.ABOVE))


def encode_levels(levels: Bytes, row_filter: Filter) -> bytes:
    """Encode ``(H, W)`` uint8 grey levels, or ``(H, W, 3)`` uint8 RGB, as a PNG file."""
    height, width, *channels = levels.shape
    step = channels[0] if channels else 1
    lines = _filtered(levels.reshape(height, -1), step, row_filter)
    return _file((height, width), 8, _COLOUR if channels else _GREY, (), lines)


def _filtered(rows: Bytes, step: int, row_filter: Filter) -> Bytes:
    """Return ``(H, B)`` bytes less what the filter takes from them, ``(H, 1 + B)`` with its number.

    A pixel has ``step`` bytes.
    """
    lines: Bytes = KERNELS.filter_rows(np.ascontiguousarray(rows), step, row_filter)
    return lines


def _file(
    shape: tuple[int, int], bits: int, kind: int, chunks: Sequence[bytes], lines: Bytes
) -> bytes:
    height, width = shape
    # No search for repetitions but runs: on masks and noise it finds nearly all there is to find.
    deflate = zlib.compressobj(1, zlib.DEFLATED, zlib.MAX_WBITS, zlib.DEF_MEM_LEVEL, zlib.Z_RLE)
    return b"".join(
        (
            _SIGNATURE,
            _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)),
            *chunks,
            _chunk(b"IDAT", deflate.compress(lines.data) + deflate.flush()),
            _chunk(b"IEND", b""),
        )
    )


def _reversed(mask: Packed) -> Bytes:
    """Return the mask's bytes with the leftmost pixel in the highest bit."""
    used = mask.bits.view(np.uint8)[:, : -(-mask.width // 8)]
    return np.asarray(cv2.LUT(used, _REVERSED), np.uint8)


def _bits(colours: int) -> int:
    return next(bits for bits in (1, 2, 4, 8) if colours <= 1 << bits)


def _pack(labels: Bytes, bits: int) -> Bytes:
    """Return ``(H, W)`` labels with so many bits each, the leftmost in a byte's highest bits."""
    if bits == 1:
        return np.packbits(labels, axis=1)
    if bits == 8:
        return labels
    word, factor, shift = _GATHERED[bits]
    height, width = labels.shape
    whole = np.zeros((height, -(-width * bits // 8), 8 // bits), np.uint8)
    whole.reshape(height, -1)[:, :width] = labels
    words = whole.view(word)[..., 0]
    highest: npt.NDArray[np.integer] = words * words.dtype.type(factor) >> words.dtype.type(shift)
    return highest.astype(np.uint8)


def _chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
