"""Label images as PNG files of 1, 2, 4 or 8 bits a pixel with a palette.

The value of a pixel is its index; the palette only colours it. A binary mask of a real frame takes
a quarter of what its raw bytes take after LZ4. Pillow, by which `roadeval.images` decodes these
files, takes several times as long to encode them, and holds the interpreter's lock for much of it.

References
----------
"Portable Network Graphics (PNG) Specification (Third Edition)", W3C, 2025, sections 5, 9 and 11.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data.colours import ColourWithOpacity
from roadeval.data.packed import Packed

_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_PALETTE: Final = 3
_UP: Final = 2
"""The filter of every row, as its first byte names it: its bytes less those above."""

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


def encode(labels: npt.NDArray[np.uint8] | Packed, palette: Sequence[ColourWithOpacity]) -> bytes:
    """Encode ``(H, W)`` uint8 labels, each below ``len(palette)``, as a PNG file.

    Labels of two classes may be packed.
    """
    height, width = labels.shape
    bits = _bits(len(palette))
    if isinstance(labels, Packed):
        rows = _reversed(labels) if bits == 1 else _pack(labels.pixels(), bits)
    else:
        rows = _pack(labels, bits)
    # Most of a mask is as the row above it: runs of zeros, a fifth fewer bytes in less time.
    lines = np.empty((height, rows.shape[1] + 1), np.uint8)
    lines[:, 0], lines[:, 1:] = _UP, rows
    lines[1:, 1:] -= rows[:-1]
    deflate = zlib.compressobj(1, zlib.DEFLATED, zlib.MAX_WBITS, zlib.DEF_MEM_LEVEL, zlib.Z_RLE)
    head = struct.pack(">IIBBBBB", width, height, bits, _PALETTE, 0, 0, 0)
    return b"".join(
        (
            _SIGNATURE,
            _chunk(b"IHDR", head),
            _chunk(b"PLTE", bytes(value for *rgb, _ in palette for value in rgb)),
            _chunk(b"tRNS", bytes(alpha for *_, alpha in palette)),
            _chunk(b"IDAT", deflate.compress(lines.data) + deflate.flush()),
            _chunk(b"IEND", b""),
        )
    )


def _reversed(mask: Packed) -> npt.NDArray[np.uint8]:
    """Return the mask's bytes with the leftmost pixel in the highest bit."""
    used = mask.bits.view(np.uint8)[:, : -(-mask.width // 8)]
    return np.asarray(cv2.LUT(used, _REVERSED), np.uint8)


def _bits(colours: int) -> int:
    return next(bits for bits in (1, 2, 4, 8) if colours <= 1 << bits)


def _pack(labels: npt.NDArray[np.uint8], bits: int) -> npt.NDArray[np.uint8]:
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
