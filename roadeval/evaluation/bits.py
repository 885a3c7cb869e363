"""Operations on masks packed as bits, 64 pixels a word."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import isqrt

import numpy as np

from roadeval.data import TruthBits
from roadeval.data.arrays import Bits, Reach
from roadeval.kernels import KERNELS


def grow(bits: Bits, reach: Reach, truth: TruthBits) -> Bits:
    """Dilate a mask of the truth's shape by an element."""
    grown: Bits = KERNELS.dilate(bits, reach, truth.shape[1])
    return grown


@lru_cache(maxsize=8)
def square(radius: int) -> Reach:
    """Return the element of ``radius`` pixels in chessboard distance, ``(radius + 1,)`` int64."""
    return np.full(radius + 1, radius)


@lru_cache(maxsize=8)
def disk(radius: int) -> Reach:
    """Return the element of ``radius`` pixels in Euclidean distance, ``(radius + 1,)`` int64."""
    return np.array([isqrt(radius**2 - row**2) for row in range(radius + 1)])


def flat(masks: Bits | Sequence[Bits]) -> Bits:
    """Lay each mask's rows one after the other: ``(K, H * words)``."""
    stacked = np.asarray(masks, np.uint64)
    return stacked.reshape(len(stacked), stacked.shape[1] * stacked.shape[2])
