"""PNG files: label images with a palette, maps of grey levels, and colour images.

A label image has 1, 2, 4 or 8 bits a pixel: the value of a pixel is its index, the palette only
colours it. A binary mask of a real frame takes a quarter of what its raw bytes take after LZ4.

ISA-L takes a half to two thirds of zlib-ng's time, and a third of zlib's, for files of the same
size; Pillow and OpenCV take longer still.

References
----------
"Portable Network Graphics (PNG) Specification (Third Edition)", W3C, 2025, sections 5, 9 and 11.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
from isal import igzip_lib
from isal.isal_zlib import crc32

from roadeval.data import Packed
from roadeval.data.colours import ColourWithOpacity
from roadeval.kernels import KERNELS

Bytes = npt.NDArray[np.uint8]

_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_GREY, _COLOUR, _PALETTE = 0, 2, 3
"""The kinds of pixels, as a file's head names them."""

_WINDOW_BITS: Final = 9
"""Repetitions are looked for in the last 512 bytes only: on masks and on noise, one further back
costs more bits for its distance than it saves."""


def encode_labels(labels: Bytes | Packed, palette: Sequence[ColourWithOpacity]) -> bytes:
    """Encode ``(H, W)`` uint8 labels, each below ``len(palette)``, as a PNG file.

    Labels of two classes may be packed, or of another type: what is not 0 is of the second class.
    """
    bits = next(bits for bits in (1, 2, 4, 8) if len(palette) <= 1 << bits)
    if bits == 1:
        mask = labels if isinstance(labels, Packed) else Packed.of(labels)
        lines = KERNELS.mask_rows(mask.bits, mask.width)
    else:
        pixels = labels.pixels() if isinstance(labels, Packed) else labels
        lines = KERNELS.label_rows(np.ascontiguousarray(pixels, np.uint8), bits)
    colours = bytes(value for *rgb, _ in palette for value in rgb)
    opacity = bytes(alpha for *_, alpha in palette)
    chunks = _chunk(b"PLTE", colours), _chunk(b"tRNS", opacity)
    return _file(labels.shape, bits, _PALETTE, chunks, lines)


def encode_levels(levels: Bytes) -> bytes:
    """Encode ``(H, W)`` uint8 grey levels, or ``(H, W, 3)`` uint8 RGB, as a PNG file."""
    height, width, *channels = levels.shape
    step = channels[0] if channels else 1
    lines = KERNELS.filter_rows(np.ascontiguousarray(levels.reshape(height, -1)), step)
    return _file((height, width), 8, _COLOUR if channels else _GREY, (), lines)


def compress(lines: Bytes) -> bytes:
    """Pack ``(H, 1 + B)`` uint8, rows each after its filter's number, in zlib's format."""
    return igzip_lib.compress(lines.data, 1, flag=igzip_lib.COMP_ZLIB, hist_bits=_WINDOW_BITS)


def _file(
    shape: tuple[int, int], bits: int, kind: int, chunks: Sequence[bytes], lines: Bytes
) -> bytes:
    height, width = shape
    return b"".join(
        (
            _SIGNATURE,
            _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)),
            *chunks,
            _chunk(b"IDAT", compress(lines)),
            _chunk(b"IEND", b""),
        )
    )


def _chunk(name: bytes, body: bytes) -> bytes:
    head = struct.pack(">I", len(body)) + name
    return head + body + struct.pack(">I", crc32(body, crc32(name)))
