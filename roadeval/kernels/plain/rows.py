"""Rows of a PNG file.

References
----------
"Portable Network Graphics (PNG) Specification (Third Edition)", W3C, 2025, section 9.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from roadeval.data.arrays import Bits, Plane
from roadeval.data.packed import unpack

LABEL_BITS: Final = (2, 4, 8)
"""Those that a label of a PNG file may have; with one it is a mask."""


def filter_rows(rows: Plane, step: int) -> Plane:
    """Subtract from each byte its Paeth predictor.

    That is the byte to the left, above, or above the left one (the corner), whichever is nearest to
    ``left + above - corner``; of equals the first in this order.

    Parameters
    ----------
    rows
        ``(H, B)`` uint8.
    step
        Bytes from a pixel to the next.

    Returns
    -------
    numpy.ndarray
        ``(H, 1 + B)`` uint8, each row after its filter's number, 4. The differences are taken
        modulo 256; beyond the image all is 0.
    """
    height, size = rows.shape
    seen = np.zeros((1 + height, step + size), np.int16)
    seen[1:, step:] = rows
    left, above, corner = seen[1:, :size], seen[:-1, step:], seen[:-1, :size]
    each = np.stack([left, above, corner])
    nearest = np.abs(left + above - corner - each).argmin(axis=0)
    taken = np.take_along_axis(each, nearest[None], axis=0)[0].astype(np.uint8)
    return np.insert(rows - taken, 0, np.uint8(4), axis=1)


def label_rows(labels: Plane, bits: int) -> Plane:
    """Pack labels, the leftmost into a byte's highest bits, without a filter.

    Parameters
    ----------
    labels
        ``(H, W)`` uint8; of each the lowest bits are taken.
    bits
        Of a label, one of `LABEL_BITS`.

    Returns
    -------
    numpy.ndarray
        ``(H, 1 + ceil(W * bits / 8))`` uint8, each row after its filter's number, 0.
    """
    single = np.unpackbits(labels[..., None], axis=2)[..., 8 - bits :]
    return _unfiltered(single.reshape(len(labels), -1))


def mask_rows(mask: Bits, width: int) -> Plane:
    """Pack a mask of ``width`` pixels a row as `label_rows` packs labels, with a bit a pixel."""
    return _unfiltered(unpack(mask, width))


def _unfiltered(single: Plane) -> Plane:
    return np.insert(np.packbits(single, axis=1), 0, np.uint8(0), axis=1)
