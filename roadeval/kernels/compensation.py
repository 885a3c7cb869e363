"""Compiled loops over the pixels of components and their rings: what Eq. 10 and 11 need.

A component's pixels are given by its runs, in the order of the rows, see `roadeval.kernels.runs`.
Indices are unsigned: Numba checks signed ones for counting from the end, which takes a third of
the time in loops as short as these.
"""

from __future__ import annotations

import numpy as np

from roadeval.data.arrays import Bits, Image, Labels, Levels, Matrix, Places, Planes, Runs, Sums
from roadeval.kernels.compiler import compiled, inlined, part
from roadeval.kernels.words import lowest

_ONE, _TWO, _THREE = np.uintp(1), np.uintp(2), np.uintp(3)
_WORD = np.uintp(64)
_TABLED = 256
"""Pixels from which on a table of what becomes of each level is faster than computing it."""


@compiled
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


@compiled
def paint(runs: Runs, height: int, width: int) -> Labels:
    """See `plain.paint`."""
    labels = np.zeros((height, width), np.int32)
    for run in range(len(runs)):
        y, label = np.uintp(runs[run, 0]), runs[run, 3]
        for x in range(np.uintp(runs[run, 1]), np.uintp(runs[run, 2])):
            labels[y, x] = label
    return labels


# --- Rings ----------------------------------------------------------------------------------------


@compiled
def ring_sums(planes: Planes, runs: Runs, ring: Bits, count: int, width: int) -> Sums:
    """See `plain.ring_sums`.

    The ring pixels of row y that belong to a component are those within ``width`` columns of one
    of its runs in the rows ``y - width`` to ``y + width``. With a width of 1 and one component::

        row y - 1      . . . # # # . . . . .
        row y          . o o o o o o o o o .     o: columns 1 to 9
        row y + 1      . . # # . . # # # . .

    The widened runs overlap, and a pixel must count once. So the runs of all these rows are merged
    from left to right by their first columns (``upcoming`` is the next one of each row), and
    ``reached`` is the invariant: all of the component's pixels in row y left of that column have
    been counted. A widened run adds what lies right of it, and moves it to its own end. It is kept
    as ``y * columns + column``, so that what is left from an earlier row needs no clearing.
    """
    rows, columns = planes[0].shape
    sums = np.zeros((count, 7), np.int64)
    first = _first_runs(runs, rows, width)
    reached = np.zeros(count, np.int64)
    # For each row within reach: its next run, where that starts, and the run after its last.
    upcoming, ends = np.empty(2 * width + 1, np.uintp), np.empty(2 * width + 1, np.uintp)
    starts = np.empty(2 * width + 1, np.int64)
    for y in range(rows):
        for v in range(len(starts)):
            upcoming[v], ends[v] = first[y + v], first[y + v + 1]
            starts[v] = runs[upcoming[v], 1] if upcoming[v] < ends[v] else columns
        while True:
            row = _least(starts)
            if starts[row] == columns:
                break
            run, following = upcoming[row], upcoming[row] + _ONE
            upcoming[row] = following
            starts[row] = runs[following, 1] if following < ends[row] else columns
            label = np.uintp(runs[run, 3])
            start = max(runs[run, 1] - width, 0, reached[label] - y * columns)
            end = min(runs[run, 2] + width, columns)
            if start < end:
                reached[label] = y * columns + end
                _add(sums, label, planes, ring, (y, start, end))
    return sums


@part
def _first_runs(runs: Runs, rows: int, width: int) -> Places:
    """Return each row's first run, with ``width`` empty rows above and below the image."""
    first = np.zeros(rows + 2 * width + 1, np.int64)
    for run in range(len(runs)):
        first[runs[run, 0] + width + 1] += 1
    return np.cumsum(first)


@inlined
def _least(values: Places) -> np.uintp:
    """Return the place of the least value, the first of equals."""
    best = np.uintp(0)
    for each in range(1, len(values)):
        place = np.uintp(each)
        if values[place] < values[best]:
            best = place
    return best


@part
def _add(
    sums: Sums, label: np.uintp, planes: Planes, ring: Bits, stretch: tuple[int, int, int]
) -> None:
    """Add the ring's pixels in a stretch (row, start, end) to a component."""
    row, start, end = stretch
    y, word, last = np.uintp(row), np.uintp(start // 64), np.uintp((end - 1) // 64)
    part = ~np.uint64(0) << np.uint64(start % 64)
    while word <= last:
        rest = ring[y, word] & part
        part = ~np.uint64(0)
        if word == last:
            rest &= part >> np.uint64(63 - (end - 1) % 64)
        while rest:
            x = _WORD * word + np.uintp(lowest(rest))
            rest &= rest - _ONE
            sums[label, 0] += 1
            for channel, plane in enumerate(planes):
                value = np.int64(plane[y, x])
                sums[label, 1 + channel] += value
                sums[label, 4 + channel] += value * value
        word += _ONE


# --- Transfer -------------------------------------------------------------------------------------


@compiled
def transfer(image: Image, runs: Runs, source: Matrix, target: Matrix, gain: Matrix) -> Image:
    """See `plain.transfer`."""
    width = image.shape[1]
    # By one index each: to find a place from three takes as long as what is done there.
    before = image.ravel()
    after = before.copy()
    tables, place = _tables(runs, source, target, gain)
    for run in range(len(runs)):
        row, k = runs[run, 0] * width, np.uintp(runs[run, 3])
        at, end = np.uintp(3 * (row + runs[run, 1])), np.uintp(3 * (row + runs[run, 2]))
        if place[k] >= 0:
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


@part
def _tables(runs: Runs, source: Matrix, target: Matrix, gain: Matrix) -> tuple[Levels, Places]:
    """Tabulate what becomes of each level, for the components that have many pixels.

    Returns
    -------
    tables, place
        ``(768 n,)`` uint8: by component, channel and level; and ``(count,)``: which of the n
        tables is a component's, or -1.
    """
    pixels = np.zeros(len(source), np.int64)
    for run in range(len(runs)):
        pixels[runs[run, 3]] += runs[run, 2] - runs[run, 1]
    place, count = np.full(len(source), -1), 0
    for k in range(len(source)):
        if pixels[k] > _TABLED:
            place[k] = count
            count += 1
    tables = np.empty(768 * count, np.uint8)
    for each in np.flatnonzero(place >= 0):
        for entry in range(768):
            c, level = entry // 256, entry % 256
            moved = _moved(level, source[each, c], target[each, c], gain[each, c])
            tables[768 * place[each] + entry] = moved
    return tables, place


@inlined
def _moved(level: int, source: float, target: float, gain: float) -> np.uint8:
    return np.uint8(min(max(np.rint(target + (level - source) * gain), 0.0), 255.0))
