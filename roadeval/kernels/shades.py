"""Compiled loops over the pixels of components and their rings: what Eq. 10 and 11 need.

A component's pixels are given by its runs, in the order of the rows, see `roadeval.kernels.runs`.
Unsigned indices are not asked whether they count from the end, which in loops as short as these
takes a third of the time.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from roadeval.kernels.arrays import (
    Bits,
    Columns,
    Floats,
    Image,
    Labels,
    Places,
    Planes,
    Runs,
    Sums,
    Table,
)
from roadeval.kernels.words import lowest

_compiled = njit(cache=True, nogil=True)
_inlined = njit(cache=True, nogil=True, inline="always")


_NONE = np.int32(0x7FFFFFFF)
"""Greater than any label."""
_ONE, _TWO, _THREE = np.uintp(1), np.uintp(2), np.uintp(3)
_TABLED = 256
"""Pixels from which on a table of what becomes of each level is quicker than the sum itself."""


@_compiled  # type: ignore[untyped-decorator]
def run_sums(planes: Planes, runs: Runs, count: int) -> Sums:
    """See `plain.run_sums`."""
    reds, greens, blues = planes
    sums = np.zeros((count, 7), np.int64)
    for run in range(len(runs)):
        y, label = np.uintp(runs[run, 0]), np.uintp(runs[run, 3])
        start, end = np.uintp(runs[run, 1]), np.uintp(runs[run, 2])
        r1 = g1 = b1 = r2 = g2 = b2 = np.int64(0)
        for x in range(start, end):
            r, g, b = np.int64(reds[y, x]), np.int64(greens[y, x]), np.int64(blues[y, x])
            r1, g1, b1 = r1 + r, g1 + g, b1 + b
            r2, g2, b2 = r2 + r * r, g2 + g * g, b2 + b * b
        for column, value in enumerate((np.int64(end - start), r1, g1, b1, r2, g2, b2)):
            sums[label, column] += value
    return sums


# --- Labels ---------------------------------------------------------------------------------------


@_compiled  # type: ignore[untyped-decorator]
def paint(runs: Runs, height: int, width: int) -> Labels:
    """See `plain.paint`."""
    labels = np.empty((height, width), np.int32)
    run = 0
    for y in range(height):
        run = _paint_row(labels[y], runs, run, y)
    return labels


@_compiled  # type: ignore[untyped-decorator]
def _paint_row(row: Columns, runs: Runs, run: int, y: int) -> int:
    """Give row ``y`` its labels, 0 outside the runs, of which ``run`` is the first not painted."""
    for x in range(len(row)):
        row[x] = 0
    while run < len(runs) and runs[run, 0] == y:
        label = runs[run, 3]
        for x in range(np.uintp(runs[run, 1]), np.uintp(runs[run, 2])):
            row[x] = label
        run += 1
    return run


# --- Rings ----------------------------------------------------------------------------------------


@_compiled  # type: ignore[untyped-decorator]
def ring_sums(planes: Planes, runs: Runs, ring: Bits, count: int, width: int) -> Sums:
    """See `plain.ring_sums`."""
    (rows, columns), words = planes[0].shape, ring.shape[1]
    sums = np.zeros((count, 7), np.int64)
    # The last pixel that each component counted: one pixel counts once in a ring.
    last = np.full(count, -1, np.int64)
    # Labels of the rows within reach, in turn, and beside them as many columns: they stay in a
    # near cache.
    near = np.zeros((2 * width + 1, 64 * words + 2 * width), np.int32)
    greatest, least = np.empty(64, np.int32), np.empty(64, np.int32)
    spare = np.empty(64 + 2 * width, np.int32), np.empty(64 + 2 * width, np.int32)
    run = 0
    for row in range(rows + width):
        run = _paint_row(near[row % len(near), width : width + columns], runs, run, row)
        y = row - width
        if y < 0:
            continue
        for word in range(words):
            rest = ring[y, word]
            if rest:
                _bound(near, 64 * word, spare, greatest, least)
            while rest:
                bit = lowest(rest)
                rest &= rest - np.uint64(1)
                x = 64 * word + bit
                # Most pixels of a ring are near one component.
                if least[bit] == greatest[bit]:
                    _add(sums, least[bit], planes, y, x)
                else:
                    _add_each(sums, last, near, planes, (y, x))
    return sums


@_compiled  # type: ignore[untyped-decorator]
def _bound(
    near: Labels, first: int, spare: tuple[Columns, Columns], greatest: Columns, least: Columns
) -> None:
    """Give the greatest and the least label around each pixel of a word; 0 counts for neither.

    ``near`` are the rows around it, in any order, where what is around the word begins with column
    ``first``; ``spare`` is for the columns' own. Loops as simple as these run in vector
    instructions.
    """
    high, low = spare
    for x in range(len(high)):
        high[x], low[x] = 0, _NONE
    for v in range(len(near)):
        for x in range(len(high)):
            label = near[v, np.uintp(first + x)]
            high[x] = max(high[x], label)
            low[x] = min(low[x], label if label > 0 else _NONE)
    for x in range(64):
        greatest[x], least[x] = high[x], low[x]
    for shift in range(1, len(high) - 63):
        for x in range(64):
            greatest[x] = max(greatest[x], high[x + shift])
            least[x] = min(least[x], low[x + shift])


@_compiled  # type: ignore[untyped-decorator]
def _add_each(
    sums: Sums, last: Places, near: Labels, planes: Planes, place: tuple[int, int]
) -> None:
    """Add a ring's pixel, ``place`` (y, x), once to every component that ``near`` has around it."""
    y, x = place
    pixel = y * near.shape[1] + x
    for v in range(len(near)):
        for u in range(x, x + len(near)):
            label = near[v, u]
            if label > 0 and last[label] != pixel:
                last[label] = pixel
                _add(sums, label, planes, y, x)


@_inlined  # type: ignore[untyped-decorator]
def _add(sums: Sums, label: int, planes: Planes, y: int, x: int) -> None:
    # By indices: a view of an array has an owner to be counted, which takes longer than the sum.
    k, v, u = np.uintp(label), np.uintp(y), np.uintp(x)
    sums[k, 0] += 1
    for channel, plane in enumerate(planes):
        value = np.int64(plane[v, u])
        sums[k, 1 + channel] += value
        sums[k, 4 + channel] += value * value


# --- Transfer -------------------------------------------------------------------------------------


@_compiled  # type: ignore[untyped-decorator]
def transfer(image: Image, runs: Runs, source: Floats, target: Floats, gain: Floats) -> Image:
    """See `plain.transfer`."""
    width = image.shape[1]
    # By one index each: to find a place from three takes as long as what is done there.
    before = image.ravel()
    after = before.copy()
    pixels = np.zeros(len(source), np.int64)
    for run in range(len(runs)):
        pixels[runs[run, 3]] += runs[run, 2] - runs[run, 1]
    # What a component makes of a level is the same for all its pixels: a large one is tabulated.
    large = pixels > _TABLED
    tables, place = _tables(large, source, target, gain).reshape(-1), np.cumsum(large) - 1
    for run in range(len(runs)):
        row, k = runs[run, 0] * width, np.uintp(runs[run, 3])
        at, end = np.uintp(3 * (row + runs[run, 1])), np.uintp(3 * (row + runs[run, 2]))
        if large[k]:
            red = np.uintp(768 * place[k])
            green, blue = red + np.uintp(256), red + np.uintp(512)
            while at < end:
                r, g, b = before[at], before[at + _ONE], before[at + _TWO]
                after[at] = tables[red + r]
                after[at + _ONE] = tables[green + g]
                after[at + _TWO] = tables[blue + b]
                at += _THREE
        else:
            for c in range(3):
                for value in range(at + np.uintp(c), end, _THREE):
                    after[value] = _moved(before[value], source[k, c], target[k, c], gain[k, c])
    return after.reshape(image.shape)


@_compiled  # type: ignore[untyped-decorator]
def _tables(large: npt.NDArray[np.bool_], source: Floats, target: Floats, gain: Floats) -> Table:
    """Tabulate what becomes of each level in each channel of the large components, in order."""
    tables = np.empty((large.sum(), 3, 256), np.uint8)
    place = 0
    for k in range(len(large)):
        if large[k]:
            for c in range(3):
                for level in range(256):
                    tables[place, c, level] = _moved(level, source[k, c], target[k, c], gain[k, c])
            place += 1
    return tables


@_inlined  # type: ignore[untyped-decorator]
def _moved(level: int, source: float, target: float, gain: float) -> np.uint8:
    return np.uint8(min(max(np.rint(target + (level - source) * gain), 0.0), 255.0))
