"""Compiled loops over masks as bits: a word holds 64 pixels, the leftmost in its lowest bit."""

from __future__ import annotations

import numpy as np
from numba import njit

from roadeval.data.arrays import Bits, Reach, Sums, Words
from roadeval.kernels.words import ones

_compiled = njit(cache=True, nogil=True)


@_compiled  # type: ignore[untyped-decorator]
def area(words: Words) -> int:
    """See `plain.area`."""
    total = np.uint64(0)
    for word in words:
        total += ones(word)
    return int(total)


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
                    total += ones(masks[mask, word] & both[word])
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
def grow(bits: Bits, reach: Reach, width: int, outside: bool) -> Bits:
    """See `plain.grow`."""
    height, words = bits.shape
    # All rows one behind the other, with a word before and after each, so that every step is one
    # long loop, which runs in vector instructions.
    across = words + 1
    # The copy and what surrounds it set every word.
    wide = np.empty(1 + height * across, np.uint64)
    spare, grown = np.empty_like(wide), np.zeros_like(wide)
    wide[1:].reshape(height, across)[:, :words] = bits
    _surround(wide, across, width, outside)
    done = 0
    # The rows furthest away first: what reached there grows on for those that are nearer.
    for away in range(len(reach) - 1, -1, -1):
        while done < reach[away]:
            # Of what is set at the side half is cut off, and the other half must do.
            step = min(reach[away] - done, done + 1, 63)
            _widen(wide[:-2], wide[1:-1], wide[2:], spare[1:-1], np.uint64(step))
            wide, spare = spare, wide
            _surround(wide, across, width, outside)
            done += step
        if away < height:
            rest = len(wide) - away * across
            _unite(grown[away * across :], wide[:rest])
            if away:
                _unite(grown[:rest], wide[away * across :])
    result = grown[1:].reshape(height, across)[:, :words].copy()
    if outside:
        near = min(len(reach) - 1, height)
        result[:near] = ~np.uint64(0)
        result[height - near :] = ~np.uint64(0)
        result[:, words - 1] &= _inside(width)
    return result


@_compiled  # type: ignore[untyped-decorator]
def _inside(width: int) -> np.uint64:
    """Give the bits of a row's last word that lie within the width."""
    rest = np.uint64(width % 64)
    return ~np.uint64(0) if rest == 0 else (np.uint64(1) << rest) - np.uint64(1)


@_compiled  # type: ignore[untyped-decorator]
def _surround(wide: Bits, across: int, width: int, outside: bool) -> None:
    """Set, or clear, what lies between rows and beyond their width."""
    inside = _inside(width)
    beyond = ~np.uint64(0) if outside else np.uint64(0)
    wide[0] = beyond
    for y in range(across, len(wide), across):
        wide[y] = beyond
        wide[y - 1] = wide[y - 1] & inside | beyond & ~inside


@_compiled  # type: ignore[untyped-decorator]
def _widen(before: Bits, here: Bits, after: Bits, wide: Bits, step: np.uint64) -> None:
    """Set every bit of ``wide`` that is so many pixels from one that is set, or nearer."""
    back = np.uint64(64) - step
    for word in range(len(here)):
        left, right = here[word] << step | before[word] >> back, here[word] >> step
        wide[word] = here[word] | left | right | after[word] << back


@_compiled  # type: ignore[untyped-decorator]
def _unite(grown: Bits, more: Bits) -> None:
    for word in range(len(more)):
        grown[word] |= more[word]
