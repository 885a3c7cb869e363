"""Pixels by outcome (section 5): many masks in many regions, counted in one pass."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import isqrt

import numpy as np

from roadeval.data import ERRORS, Layer, Mask, Truth, TruthBits, everywhere
from roadeval.data.arrays import Bits, Reach, Sums
from roadeval.kernels import KERNELS


def count(masks: Bits, truth: TruthBits, regions: Sequence[Bits]) -> Sums:
    """Count TP, TN, FP and FN of each mask, in the whole frame and in each region.

    Parameters
    ----------
    masks
        ``(K, H, words)``: road.
    truth
        Ignored pixels are in no count.
    regions
        R of ``(H, words)``; they may overlap.

    Returns
    -------
    numpy.ndarray
        ``(K, 1 + R, 4)`` int64: of each mask the whole frame's four, then each region's.
    """
    inside = flat([everywhere(truth.shape), *regions])
    classes = flat([truth.road, truth.other])
    positives, negatives = KERNELS.count_bits(inside[:1], classes, inside)[0]
    tp, fp = KERNELS.count_bits(flat(masks), classes, inside).transpose(1, 0, 2)
    return np.stack([tp, negatives - fp, fp, positives - tp], axis=2)


def error_map(mask: Mask, truth: Truth) -> Layer:
    """Classify each pixel by its outcome, as in `roadeval.data.ERRORS`.

    Parameters
    ----------
    mask
        ``(H, W)`` uint8, 0 or 1.
    truth
        ``(H, W)`` uint8: 0, 1, or 255 for ignored.
    """
    return Layer(ERRORS, KERNELS.outcomes(mask, truth))


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
