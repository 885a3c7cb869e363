"""Compiled loops over masks as bits: a word holds 64 pixels, the leftmost in its lowest bit."""

from __future__ import annotations

import numpy as np

from roadeval.data.arrays import Bits, Reach, Sums, Words
from roadeval.kernels.compiler import compiled, part
from roadeval.kernels.words import ones


@compiled
def count_bits(masks: Bits, classes: Bits, regions: Bits) -> Sums:
    """See `plain.count_bits`."""
    counts = np.zeros((len(masks), len(classes), len(regions)), np.int64)
    both = np.empty(masks.shape[1], np.uint64)
    for region in range(len(regions)):
        # Many regions are a part of the rows: the words before and after it hold no pixel.
        # Indices are unsigned, or these loops would not run in vector instructions.
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


@part
def _span(bits: Bits, row: int) -> tuple[np.uintp, np.uintp]:
    """Return the first word of a row that is not 0, and the one after the last."""
    first, last = 0, bits.shape[1]
    while last > 0 and not bits[row, last - 1]:
        last -= 1
    while first < last and not bits[row, first]:
        first += 1
    return np.uintp(first), np.uintp(last)


@compiled
def grow(bits: Bits, reach: Reach, width: int, outside: bool) -> Bits:
    """See `plain.grow`.

    The mask's rows lie in one array, with a word between them for what is outside the image::

        wide:   | . | row 0 | . | row 1 | . | row 2 | . |      across = words in a row + 1

    so that the row that lies ``away`` rows below is the one ``away * across`` words later, and each
    step below is one long loop, which runs in vector instructions.

    The element is a stack of stretches that narrow with the distance from its middle row::

        away 2       # #          reach[2] = 1
        away 1     # # # #        reach[1] = 2
        away 0   # # # # # #      reach[0] = 3

    They are taken from the outermost inwards. Before each, ``wide`` is the mask widened by ``done``
    pixels to either side; widened further until ``done`` is ``reach[away]`` it is united with
    ``grown``, moved up and down by ``away`` rows. So no widening is done twice.
    """
    height, words = bits.shape
    across = words + 1
    size = 1 + height * across
    wide, spare, grown = (
        np.empty(size, np.uint64),
        np.empty(size, np.uint64),
        np.zeros(size, np.uint64),
    )
    for y in range(height):
        for word in range(words):
            wide[1 + y * across + word] = bits[y, word]
    _surround(wide, across, width, outside)
    done = 0
    for away in range(len(reach) - 1, -1, -1):
        while done < reach[away]:
            # A set pixel is by now a stretch of 2 done + 1, or of done + 1 where the image's side
            # cuts it off: moved by no more than done + 1 it leaves no gap. A word moves by 63 bits
            # at most.
            step = min(reach[away] - done, done + 1, 63)
            _widen(wide[:-2], wide[1:-1], wide[2:], spare[1:-1], np.uint64(step))
            wide, spare = spare, wide
            _surround(wide, across, width, outside)
            done += step
        if away < height:
            rest = size - away * across
            _unite(grown[away * across :], wide[:rest])
            if away:
                _unite(grown[:rest], wide[away * across :])
    return _image(grown, (height, words), width, min(len(reach) - 1, height) if outside else 0)


@part
def _image(grown: Words, shape: tuple[int, int], width: int, edge: int) -> Bits:
    """Return the rows that lie in ``grown``; all of the ``edge`` first and last are set."""
    height, words = shape
    inside = _inside(width)
    result = np.empty(shape, np.uint64)
    for y in range(height):
        reached = y < edge or y >= height - edge
        for word in range(words):
            result[y, word] = ~np.uint64(0) if reached else grown[1 + y * (words + 1) + word]
        result[y, words - 1] &= inside
    return result


@part
def _inside(width: int) -> np.uint64:
    """Return the bits of a row's last word that lie within the width."""
    rest = np.uint64(width % 64)
    return ~np.uint64(0) if rest == 0 else (np.uint64(1) << rest) - np.uint64(1)


@part
def _surround(wide: Words, across: int, width: int, outside: bool) -> None:
    """Set, or clear, what lies between rows and beyond their width."""
    inside = _inside(width)
    beyond = ~np.uint64(0) if outside else np.uint64(0)
    wide[0] = beyond
    for y in range(across, len(wide), across):
        wide[y] = beyond
        wide[y - 1] = wide[y - 1] & inside | beyond & ~inside


@part
def _widen(before: Words, here: Words, after: Words, wide: Words, step: np.uint64) -> None:
    """Set each pixel of ``wide`` that is set in ``here``, or ``step`` pixels left or right."""
    back = np.uint64(64) - step
    for word in range(len(here)):
        left, right = here[word] << step | before[word] >> back, here[word] >> step
        wide[word] = here[word] | left | right | after[word] << back


@part
def _unite(grown: Words, more: Words) -> None:
    for word in range(len(more)):
        grown[word] |= more[word]
