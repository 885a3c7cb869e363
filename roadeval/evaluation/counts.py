"""Pixels by outcome (section 5): many masks in many regions, counted in one pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from roadeval.data import ERRORS, Counts, Layer, Mask, Truth
from roadeval.evaluation.bits import TruthBits, flat
from roadeval.kernels import KERNELS
from roadeval.kernels.arrays import Bits
from roadeval.kernels.packing import everywhere

IGNORED: Final = 4
"""The class of `roadeval.data.ERRORS` beside TN, TP, FP and FN, which are 0 to 3."""


@dataclass(frozen=True, slots=True)
class MaskCounts:
    """The counts of one mask on one frame, in the whole frame and by region."""

    whole: Counts
    regions: dict[str, Counts]


def count(masks: Bits, truth: TruthBits, regions: Mapping[str, Bits]) -> tuple[MaskCounts, ...]:
    """Count TP, TN, FP and FN of each mask, in the whole frame and in each region.

    Parameters
    ----------
    masks
        ``(K, H, words)``: road.
    truth
        Ignored pixels are in no count.
    regions
        ``(H, words)`` each; regions may overlap.

    Returns
    -------
    tuple of MaskCounts
        One for each mask, in their order.
    """
    whole = everywhere(truth.shape)
    inside, classes = flat([whole, *regions.values()]), flat([truth.road, truth.other])
    positives, negatives = KERNELS.count_bits(flat([whole]), classes, inside)[0]
    tp, fp = KERNELS.count_bits(flat(masks), classes, inside).transpose(1, 0, 2)
    counted = []
    for rows in np.stack([tp, negatives - fp, fp, positives - tp], axis=2).tolist():
        total, *parts = (Counts(*row) for row in rows)
        counted.append(MaskCounts(total, dict(zip(regions, parts, strict=True))))
    return tuple(counted)


def error_map(mask: Mask, truth: Truth) -> Layer:
    """Say of each pixel how it came out, in the classes of `roadeval.data.ERRORS`.

    Parameters
    ----------
    mask
        ``(H, W)`` uint8, 0 or 1.
    truth
        ``(H, W)`` uint8: 0, 1, or 255 for ignored.
    """
    return Layer(ERRORS, KERNELS.outcomes(mask, truth, IGNORED))
