"""Masks as bits: a machine word holds 64 pixels, so that many masks are counted in one pass."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import isqrt

import numpy as np

from roadeval.data import NON_ROAD, ROAD, Truth
from roadeval.kernels import KERNELS
from roadeval.kernels.arrays import Bits, Reach
from roadeval.kernels.packing import Packed, pack


@dataclass(frozen=True, slots=True, eq=False)
class TruthBits:
    """A truth as bits: ``shape`` (H, W), the ``road`` and the ``other`` (non-road) pixels."""

    shape: tuple[int, int]
    road: Bits
    other: Bits

    @classmethod
    def of(cls, truth: Truth) -> TruthBits:
        """Pack an ``(H, W)`` uint8 truth (0, 1, 255)."""
        height, width = truth.shape
        return cls((height, width), pack(truth == ROAD), pack(truth == NON_ROAD))

    @property
    def labelled(self) -> Bits:
        """The pixels that are not ignored."""
        return self.road | self.other

    def bits_of(self, masks: Iterable[Packed]) -> Bits:
        """Lay the bits of masks of the truth's shape one behind the other: ``(K, H, words)``.

        Raises
        ------
        ValueError
            If one has another shape.
        """
        bits = []
        for mask in masks:
            if mask.shape != self.shape:
                raise ValueError(f"shape {mask.shape} differs from the truth's {self.shape}")
            bits.append(mask.bits)
        return np.array(bits, np.uint64).reshape(len(bits), *self.road.shape)

    def grow(self, bits: Bits, reach: Reach) -> Bits:
        """Dilate a mask of the truth's shape by an element."""
        grown: Bits = KERNELS.grow(bits, reach, self.shape[1], False)
        return grown


@lru_cache(maxsize=8)
def square(radius: int) -> Reach:
    """Give the element of ``radius`` pixels in chessboard distance, ``(radius + 1,)`` int64."""
    return np.full(radius + 1, radius)


@lru_cache(maxsize=8)
def disk(radius: int) -> Reach:
    """Give the element of ``radius`` pixels in Euclidean distance, ``(radius + 1,)`` int64."""
    return np.array([isqrt(radius**2 - row**2) for row in range(radius + 1)])


def flat(masks: Bits | Sequence[Bits]) -> Bits:
    """Lay each mask's rows one after the other: ``(K, H * words)``."""
    stacked = np.asarray(masks, np.uint64)
    return stacked.reshape(len(stacked), stacked.shape[1] * stacked.shape[2])
