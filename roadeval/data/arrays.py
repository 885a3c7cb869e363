"""Types of arrays that kernels take and return, and masks packed as bits."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Self
from zlib import crc32

import numpy as np
import numpy.typing as npt

from roadeval.data.frame import NON_ROAD, ROAD, Truth

Image = npt.NDArray[np.uint8]
"""``(H, W, 3)`` RGB."""
Plane = npt.NDArray[np.uint8]
"""``(H, W)``: a channel, codes of any kind, or a mask, nonzero inside."""
Planes = tuple[Plane, Plane, Plane]
"""Red, green and blue."""
Labels = npt.NDArray[np.int32]
"""``(H, W)``: a component's number at each of its pixels, 0 outside."""
Runs = npt.NDArray[np.int32]
"""``(n, 4)``: row, first column, column after the last, and label, by rows and from left to
right."""
Costs = npt.NDArray[np.uint16]
"""``(H, W)``: the cost of a step of length 1 at each pixel."""
Distances = npt.NDArray[np.int32]
"""``(H, W)``: the cost of the cheapest path to each pixel."""
Indices = npt.NDArray[np.int32]
"""``(n, m)``: indices into a list."""
Masks = npt.NDArray[np.uint32]
"""``(n, m)``: 32 bits each."""
Places = npt.NDArray[np.intp]
"""``(n,)``: rows, columns, or positions in a list."""
Flags = npt.NDArray[np.bool_]
"""``(n,)``: one flag each."""
Sums = npt.NDArray[np.int64]
"""``(n, ...)``: whole numbers by label or kind."""
Values = npt.NDArray[np.floating]
"""float32 of any shape. The type is wider because NumPy's stubs widen it with Python floats."""
Floats = npt.NDArray[np.float64]
"""float64 of any shape."""
Bits = npt.NDArray[np.uint64]
"""``(H, words)`` of an ``(H, W)`` mask, C-contiguous, 64 pixels a word, the leftmost in the lowest
bit; bits beyond the width are 0. K masks are ``(K, H, words)``."""
Words = npt.NDArray[np.uint64]
"""``(n,)``: 64 bits a word."""
Reach = npt.NDArray[np.int64]
"""``(r + 1,)``: a structuring element that is symmetric in both directions. Entry i is its extent
in pixels to either side, i rows above and below the middle row; the entries never increase."""


def sigmoid(values: Values) -> Values:
    """Compute ``1 / (1 + exp(-x))`` of float32 without overflow."""
    return 0.5 + 0.5 * np.tanh(0.5 * values)


TN: Final = 0
TP: Final = 1
FP: Final = 2
FN: Final = 3
IGNORED: Final = 4
"""Codes of the outcome of a pixel. They never change, because recordings hold them."""


@dataclass(frozen=True, eq=False)
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
        """Return ``(H, W)`` uint8, 0 or 1."""
        return unpack(self.bits, self.width)


def pack(mask: npt.NDArray[np.uint8] | npt.NDArray[np.bool_]) -> Bits:
    """Pack an ``(H, W)`` mask, nonzero inside, into ``(H, ceil(W / 64))`` uint64."""
    packed = np.packbits(mask, axis=1, bitorder="little")
    if packed.shape[1] % 8:
        packed = np.pad(packed, ((0, 0), (0, -packed.shape[1] % 8)))
    return np.ascontiguousarray(packed).view(np.uint64)


def ones(bits: Bits) -> int:
    """Count the set bits."""
    return int(np.bitwise_count(bits).sum())


@lru_cache(maxsize=8)
def everywhere(shape: tuple[int, int]) -> Bits:
    """Return the mask of all pixels of an image of ``shape`` (H, W), shared and read-only."""
    bits = pack(np.ones(shape, np.uint8))
    bits.flags.writeable = False
    return bits


def unpack(bits: Bits, width: int) -> Plane:
    """Unpack bits to an ``(H, width)`` uint8 mask, 0 or 1."""
    return np.unpackbits(bits.view(np.uint8), axis=1, count=width, bitorder="little")


@dataclass(frozen=True, eq=False)
class TruthBits:
    """A truth as `Bits`: ``shape`` (H, W), the ``road`` and the ``other`` (non-road) pixels."""

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

    def checksum(self) -> int:
        """Return the CRC-32 of the road and the other pixels, which identifies the truth."""
        return crc32(self.other.tobytes(), crc32(self.road.tobytes()))

    def bits_of(self, masks: Iterable[Packed]) -> Bits:
        """Stack the bits of masks, ``(K, H, words)``; a `ValueError` if one has another shape."""
        bits = []
        for mask in masks:
            if mask.shape != self.shape:
                raise ValueError(f"shape {mask.shape} differs from the truth's {self.shape}")
            bits.append(mask.bits)
        return np.array(bits, np.uint64).reshape(len(bits), *self.road.shape)
