"""Masks of a bit a pixel: counted, dilated and eroded."""

from __future__ import annotations

from typing import Any, Final

import cv2
import numpy as np

from roadeval.data.arrays import Bits, Plane, Reach, Sums
from roadeval.data.packed import pack, unpack

_AROUND: Final[dict[str, Any]] = {"borderType": cv2.BORDER_CONSTANT, "borderValue": 0}
"""Nothing is set around a mask."""


def count_bits(masks: Bits, classes: Bits, regions: Bits) -> Sums:
    """Count pixels in a mask, of a class and in a region: the set bits of three words' conjunction.

    ``masks``, ``classes`` and ``regions`` are ``(M, n)``, ``(C, n)`` and ``(R, n)`` uint64; the
    counts are ``(M, C, R)`` int64.
    """
    both = classes[:, None] & regions[None]
    counts = [np.bitwise_count(both & mask).sum(axis=2, dtype=np.int64) for mask in masks]
    return np.array(counts, np.int64).reshape(len(masks), *both.shape[:2])


def dilate(bits: Bits, reach: Reach, width: int) -> Bits:
    """Dilate a mask of ``width`` pixels a row by an element; nothing around it is set."""
    return pack(cv2.dilate(unpack(bits, width), _element(reach), **_AROUND))


def erode(bits: Bits, reach: Reach, width: int) -> Bits:
    """Erode a mask of ``width`` pixels a row by an element; nothing around it is set."""
    return pack(cv2.erode(unpack(bits, width), _element(reach), **_AROUND))


def _element(reach: Reach) -> Plane:
    side = 2 * max(len(reach) - 1, int(reach.max())) + 1
    rows, columns = np.abs(np.indices((side, side)) - side // 2)
    inside: Plane = (rows < len(reach)) & (columns <= reach[np.minimum(rows, len(reach) - 1)])
    return inside.astype(np.uint8)
