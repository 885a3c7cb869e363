"""Compiled loops over masks as bits: a word holds 64 pixels, the leftmost in its lowest bit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic

from roadeval.kernels.arrays import Bits, Reach, Sums

_compiled = njit(cache=True, nogil=True)


@intrinsic  # type: ignore[untyped-decorator]
def _ones(_context: Any, _word: Any) -> Any:
    """Count the set bits of a word, by the processor's own instruction where it has one."""

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])

    return types.uint64(types.uint64), build


@_compiled  # type: ignore[untyped-decorator]
def count_bits(masks: Bits, classes: Bits, regions: Bits) -> Sums:
    """See `plain.count_bits`."""
    counts = np.zeros((len(masks), len(classes), len(regions)), np.int64)
    both = np.empty(masks.shape[1], np.uint64)
    for region in range(len(regions)):
        # Many a region is a part of the rows, and nothing lies beyond. Unsigned, or these loops
        # would not run in vector instructions.
        first, last = _span(regions, region)
        for kind in range(len(classes)):
            for word in range(first, last):
                both[word] = regions[region, word] & classes[kind, word]
            for mask in range(len(masks)):
                total = np.uint64(0)
                for word in range(first, last):
                    total += _ones(masks[mask, word] & both[word])
                counts[mask, kind, region] = total
    return counts


@_compiled  # type: ignore[untyped-decorator]
def _span(bits: Bits, row: int) -> tuple[np.uintp, np.uintp]:
    """Find the first word of a row that is not 0, and the end of the last one."""
    first, last = 0, bits.shape[1]
    while last > 0 and not bits[row, last - 1]:
        last -= 1
    while first < last and not bits[row, first]:
        first += 1
    return np.uintp(first), np.uintp(last)


@_compiled  # type: ignore[untyped-decorator]
def grow(bits: Bits, reach: Reach, width: int) -> Bits:
    """See `plain.grow`."""
    height, words = bits.shape
    grown = np.zeros_like(bits)
    # With a clear word at both ends, beside which nothing is to be asked.
    wide, spare = np.zeros(words + 2, np.uint64), np.zeros(words + 2, np.uint64)
    # Bits beyond the image's width stay clear.
    rest = np.uint64(width % 64)
    last = ~np.uint64(0) if rest == 0 else (np.uint64(1) << rest) - np.uint64(1)
    for y in range(height):
        some = np.uint64(0)
        for word in range(words):
            wide[word + 1] = bits[y, word]
            some |= bits[y, word]
        if not some:
            continue
        done = 0
        # The rows furthest away first: what reached there grows on for those that are nearer.
        for away in range(len(reach) - 1, -1, -1):
            _widen(wide, spare, done, reach[away])
            wide[words] &= last
            done = reach[away]
            for v in (y - away, y + away):
                if 0 <= v < height:
                    for word in range(words):
                        grown[v, word] |= wide[word + 1]
    return grown


@_compiled  # type: ignore[untyped-decorator]
def _widen(wide: Bits, spare: Bits, done: int, pixels: int) -> None:
    """Set every bit within so many pixels of a set one, where that is done up to ``done``."""
    words = len(wide) - 2
    while done < pixels:
        # At the image's side half of what was set is cut off, and the other half must do.
        step = min(pixels - done, done + 1, 63)
        shift, back = np.uint64(step), np.uint64(64 - step)
        for word in range(words + 2):
            spare[word] = wide[word]
        for word in range(1, words + 1):
            up = spare[word] << shift | spare[word - 1] >> back
            wide[word] |= up | spare[word] >> shift | spare[word + 1] << back
        done += step
