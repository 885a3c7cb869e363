"""Pixels by outcome (section 5): many masks in many regions, counted in one pass.

Masks are packed to bits, so that one machine word holds 64 pixels, and the pixels that lie in a
mask, in a region and on the road are the set bits of three words' conjunction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import ERRORS, IGNORE, NON_ROAD, ROAD, Counts, Layer, Mask, Truth

Bits = npt.NDArray[np.uint64]
"""``(K, words)`` uint64: K masks, 64 pixels a word, padded with zeros."""


@dataclass(frozen=True, slots=True)
class MaskCounts:
    """The counts of one mask on one frame, in the whole frame and by region."""

    whole: Counts
    regions: dict[str, Counts]


def count(
    masks: Sequence[Mask], truth: Truth, regions: Mapping[str, Mask]
) -> tuple[MaskCounts, ...]:
    """Count TP, TN, FP and FN of each mask, in the whole frame and in each region.

    Parameters
    ----------
    masks
        Each ``(H, W)`` uint8 or bool, non-zero for road.
    truth
        ``(H, W)`` uint8: 0 non-road, 1 road, 255 ignored; ignored pixels are in no count.
    regions
        Each ``(H, W)`` uint8 or bool, non-zero inside; regions may overlap.

    Returns
    -------
    tuple of MaskCounts
        One for each mask, in their order.

    Raises
    ------
    ValueError
        If a mask or a region has not the truth's shape.
    """
    _require_shape(truth.shape, *masks, *regions.values())
    inside = pack([np.ones(truth.shape, np.uint8), *regions.values()])
    road = inside & pack([truth == ROAD])
    other = inside & pack([truth == NON_ROAD])
    positives, negatives = _ones(road), _ones(other)
    counted = []
    for mask in pack(masks):
        tp, fp = _ones(road & mask), _ones(other & mask)
        table = np.stack([tp, negatives - fp, fp, positives - tp], axis=1).tolist()
        whole, *parts = (Counts(*row) for row in table)
        counted.append(MaskCounts(whole, dict(zip(regions, parts, strict=True))))
    return tuple(counted)


def pack(masks: Sequence[npt.NDArray[np.uint8] | npt.NDArray[np.bool_]]) -> Bits:
    """Pack equally large masks to bits, one row a mask."""
    if not masks:
        return np.zeros((0, 0), np.uint64)
    size = -(-masks[0].size // 64) * 8
    packed = np.zeros((len(masks), size), np.uint8)
    for row, mask in zip(packed, masks, strict=True):
        bits = np.packbits(mask)
        row[: bits.size] = bits
    return packed.view(np.uint64)


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


def labelled_pixels(truth: Truth) -> int:
    """Count the pixels that the truth does not ignore: N of Eq. 24 and 25."""
    return int(truth.size - np.count_nonzero(truth == IGNORE))


def _outcomes() -> npt.NDArray[np.uint8]:
    """Tabulate class by ``2 * truth + mask`` modulo 256, where an ignored pixel has 254 or 255."""
    value = {label.name: label.value for label in ERRORS.classes}
    table = np.full(256, value["ignored"], np.uint8)
    table[:4] = value["TN"], value["FP"], value["FN"], value["TP"]
    return table


_OUTCOMES: Final = _outcomes()


def _ones(bits: Bits) -> npt.NDArray[np.int64]:
    """Count the set bits of each row."""
    ones: npt.NDArray[np.int64] = np.bitwise_count(bits).sum(axis=1, dtype=np.int64)
    return ones


def _require_shape(shape: tuple[int, ...], *arrays: npt.NDArray[np.uint8]) -> None:
    for array in arrays:
        if array.shape != shape:
            raise ValueError(f"shape {array.shape} differs from the truth's {shape}")
