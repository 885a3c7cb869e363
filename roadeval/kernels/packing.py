"""Masks with 64 pixels a word: what is asked of a mask is asked of so many pixels at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
import numpy.typing as npt

from roadeval.kernels import KERNELS
from roadeval.kernels.arrays import Bits, Plane


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """A mask as `Bits`, and its ``width`` in pixels."""

    bits: Bits
    width: int

    @classmethod
    def of(cls, mask: npt.NDArray[np.uint8] | npt.NDArray[np.bool_]) -> Self:
        """Pack an ``(H, W)`` mask, nonzero inside."""
        return cls(pack(mask), mask.shape[1])

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return len(self.bits), self.width

    def pixels(self) -> Plane:
        """Give ``(H, W)`` uint8, 0 or 1."""
        return unpack(self.bits, self.width)

    def area(self) -> int:
        """Count the pixels inside."""
        return ones(self.bits)


def pack(mask: npt.NDArray[np.uint8] | npt.NDArray[np.bool_]) -> Bits:
    """Pack an ``(H, W)`` mask, nonzero inside, into ``(H, ceil(W / 64))`` uint64."""
    packed = np.packbits(mask, axis=1, bitorder="little")
    if packed.shape[1] % 8:
        packed = np.pad(packed, ((0, 0), (0, -packed.shape[1] % 8)))
    return np.ascontiguousarray(packed).view(np.uint64)


def ones(bits: Bits) -> int:
    """Count the set bits."""
    return int(KERNELS.area(bits.ravel()))


@lru_cache(maxsize=8)
def everywhere(shape: tuple[int, int]) -> Bits:
    """Give the mask that holds every pixel of an image of ``shape`` (H, W): shared, read-only."""
    bits = pack(np.ones(shape, np.uint8))
    bits.flags.writeable = False
    return bits


def unpack(bits: Bits, width: int) -> Plane:
    """Give the ``(H, width)`` uint8 mask, 0 or 1, that was packed."""
    return np.unpackbits(bits.view(np.uint8), axis=1, count=width, bitorder="little")
