"""Pixels by outcome (section 5): many masks in many regions, counted in one pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import ERRORS, Counts, Layer, Mask, Truth
from roadeval.evaluation.bits import Bits, TruthBits, everywhere, flat
from roadeval.kernels import KERNELS


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
    counted = []
    for tp, fp in KERNELS.count_bits(flat(masks), classes, inside):
        table = np.stack([tp, negatives - fp, fp, positives - tp], axis=1).tolist()
        total, *parts = (Counts(*row) for row in table)
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
    import cv2

    return Layer(ERRORS, cv2.LUT(truth * np.uint8(2) + mask, _OUTCOMES))


def _outcomes() -> npt.NDArray[np.uint8]:
    """Tabulate class by ``2 * truth + mask`` modulo 256, where an ignored pixel has 254 or 255."""
    value = {label.name: label.value for label in ERRORS.classes}
    table = np.full(256, value["ignored"], np.uint8)
    table[:4] = value["TN"], value["FP"], value["FN"], value["TP"]
    return table


_OUTCOMES: Final = _outcomes()
