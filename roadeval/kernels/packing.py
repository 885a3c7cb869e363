"""Masks with 64 pixels a word: what is asked of a mask is asked of so many pixels at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

Mask = npt.NDArray[np.uint8]
Bits = npt.NDArray[np.uint64]
"""``(H, words)`` uint64 of an ``(H, W)`` mask, the leftmost pixel in the lowest bit; those beyond
the width are 0. ``(K, H, words)`` of K masks."""
Reach = npt.NDArray[np.int64]
"""A structuring element that is symmetric in both directions, ``(r + 1,)`` int64: how many pixels
it extends to either side in its own row and in each of the r rows above and below, never more in a
row further away."""


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """A mask as `Bits`, and its ``width`` in pixels."""

    bits: Bits
    width: int

    @classmethod
    def of(cls, mask: Mask) -> Self:
        """Pack an ``(H, W)`` mask, nonzero inside."""
        return cls(pack(mask), mask.shape[1])

    def mask(self) -> Mask:
        """Give ``(H, W)`` uint8, 0 or 1."""
        return unpack(self.bits, self.width)


def pack(mask: npt.NDArray[np.uint8] | npt.NDArray[np.bool_]) -> Bits:
    """Pack an ``(H, W)`` mask, nonzero inside."""
    packed = np.packbits(mask, axis=1, bitorder="little")
    if packed.shape[1] % 8:
        packed = np.pad(packed, ((0, 0), (0, -packed.shape[1] % 8)))
    return np.ascontiguousarray(packed).view(np.uint64)


def unpack(bits: Bits, width: int) -> Mask:
    """Give the ``(H, width)`` uint8 mask, 0 or 1, that was packed."""
    return np.unpackbits(bits.view(np.uint8), axis=1, count=width, bitorder="little")
