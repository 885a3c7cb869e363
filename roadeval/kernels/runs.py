"""Compiled loops over masks by runs: components and holes.

A run is a stretch of equal pixels in a row, from ``start`` up to but not including ``end``. A
mask that was opened and closed has a few of them a row, so that what is asked of its components
is asked of some thousand runs instead of all pixels.
"""

from __future__ import annotations

import numpy as np

from roadeval.data.arrays import Bits, Columns, Flags, Labels, Parents, Places, Plane, Runs
from roadeval.kernels.compiler import compiled, inlined, part
from roadeval.kernels.words import lowest

_ONE = np.uintp(1)
"""Indices are unsigned where loops are short: Numba checks signed ones for counting from the end.
"""


@compiled
def components(bits: Bits, width: int, connectivity: int) -> tuple[Runs, int]:
    """See `plain.components`."""
    rows, starts, ends = _runs(bits, width, True)
    parents = _joined(rows, starts, ends, 1 if connectivity == 8 else 0)
    runs = np.empty((len(starts), 4), np.int32)
    count = 0
    for y in range(len(bits)):
        for run in range(np.uintp(rows[y]), np.uintp(rows[y + 1])):
            # A component's number is its first run's, which comes before the others.
            if parents[run] == run:
                count += 1
                label = count
            else:
                label = runs[parents[run], 3]
            runs[run, 0], runs[run, 1], runs[run, 2], runs[run, 3] = (
                y,
                starts[run],
                ends[run],
                label,
            )
    return runs, count


@compiled
def label_runs(labels: Labels) -> Runs:
    """See `plain.label_runs`."""
    height, width = labels.shape
    runs = np.empty((height * width, 4), np.int32)
    count = 0
    for y in range(height):
        x = 0
        while x < width:
            start, label = x, labels[y, x]
            while x < width and labels[y, x] == label:
                x += 1
            if label > 0:
                runs[count, 0], runs[count, 1] = y, start
                runs[count, 2], runs[count, 3] = x, label
                count += 1
    return runs[:count].copy()


@compiled
def keep_region(bits: Bits, width: int, patch: Plane) -> Bits:
    """See `plain.keep_region`."""
    rows, starts, ends = _runs(bits, width, True)
    parents = _joined(rows, starts, ends, 1)
    chosen = np.zeros(len(parents), np.bool_)
    areas = np.zeros(len(parents), np.int64)
    inside = np.zeros(len(parents), np.int64)
    for y in range(len(bits)):
        for run in range(rows[y], rows[y + 1]):
            areas[parents[run]] += ends[run] - starts[run]
            if patch.size:
                for x in range(starts[run], ends[run]):
                    inside[parents[run]] += patch[y, x] > 0
    # A component's own number is its first run's: of equals the first from the top is found.
    if len(parents):
        chosen[np.argmax(inside) if inside.any() else np.argmax(areas)] = True
    kept = np.zeros_like(bits)
    _set_runs(kept, rows, starts, ends, chosen[parents])
    return kept


@compiled
def fill_holes(bits: Bits, width: int) -> Bits:
    """See `plain.fill_holes`."""
    height = len(bits)
    rows, starts, ends = _runs(bits, width, False)
    parents = _joined(rows, starts, ends, 0)
    outside = np.zeros(len(parents), np.bool_)
    for y in range(height):
        for run in range(rows[y], rows[y + 1]):
            if y == 0 or y == height - 1 or starts[run] == 0 or ends[run] == width:
                outside[parents[run]] = True
    filled = bits.copy()
    _set_runs(filled, rows, starts, ends, ~outside[parents])
    return filled


@part
def _set_runs(bits: Bits, rows: Places, starts: Columns, ends: Columns, chosen: Flags) -> None:
    """Set the pixels of the chosen runs."""
    for y in range(len(bits)):
        for run in range(rows[y], rows[y + 1]):
            if chosen[run]:
                _set(bits, y, starts[run], ends[run])


@part
def _set(bits: Bits, y: int, start: int, end: int) -> None:
    """Set the bits of a row from ``start`` up to but not including ``end``."""
    word, stop = start // 64, end // 64
    part = ~np.uint64(0) << np.uint64(start % 64)
    while word < stop:
        bits[y, word] |= part
        part, word = ~np.uint64(0), word + 1
    if end % 64:
        bits[y, word] |= part & ((np.uint64(1) << np.uint64(end % 64)) - np.uint64(1))


@part
def _runs(bits: Bits, width: int, inside: bool) -> tuple[Places, Columns, Columns]:
    """Find the runs of ones (or of zeros, if not ``inside``), row after row.

    Those of row y are numbered from ``rows[y]`` up to but not including ``rows[y + 1]``. A word is
    walked from turn to turn, a bit that differs from the one to its left::

        here     . . # # # . . # #      before the first stands a 0
        turns    . . ^ . . ^ . ^ .      a run begins at 2, ends at 5, begins at 7

    Turns alternate between beginning and end; a run that no turn ends, ends with the row.
    """
    height, words = bits.shape
    rows = np.zeros(height + 1, np.int64)
    starts = np.empty(height * (width // 2 + 1), np.int32)
    ends = np.empty_like(starts)
    count = 0
    others = np.uint64(0) if inside else ~np.uint64(0)
    for y in range(height):
        before, running = np.uint64(0), False
        for word in range(words):
            here = bits[y, word] ^ others
            turns = here ^ (here << np.uint64(1) | before)
            before = here >> np.uint64(63)
            while turns:
                place = 64 * word + lowest(turns)
                turns &= turns - np.uint64(1)
                if place >= width:
                    break
                if running:
                    ends[count] = place
                    count += 1
                else:
                    starts[count] = place
                running = not running
        if running:
            ends[count] = width
            count += 1
        rows[y + 1] = count
    return rows, starts[:count], ends[:count]


@part
def _joined(rows: Places, starts: Columns, ends: Columns, corner: int) -> Parents:
    """Join runs of neighbouring rows that touch: of each run the first one of its component.

    With ``corner`` 1 they may touch by a corner (8-connected), with 0 by a side alone.
    """
    parents = np.arange(len(starts)).astype(np.uintp)
    for y in range(1, len(rows) - 1):
        above, here = np.uintp(rows[y - 1]), np.uintp(rows[y])
        last_above, last_here = np.uintp(rows[y]), np.uintp(rows[y + 1])
        while above < last_above and here < last_here:
            if starts[above] < ends[here] + corner and starts[here] < ends[above] + corner:
                a, b = _first(parents, above), _first(parents, here)
                parents[a] = parents[b] = parents[here] = min(a, b)
            # Whichever ends first is done with. Not a branch, which no processor could foresee.
            done = np.uintp(ends[above] < ends[here])
            above, here = above + done, here + (_ONE - done)
    for run in range(len(parents)):
        # A parent comes before its child, and is settled already.
        parents[run] = parents[parents[run]]
    return parents


@inlined
def _first(parents: Parents, run: np.uintp) -> np.uintp:
    parent = parents[run]
    while parent != run:
        parents[run] = parents[parent]
        run = parents[run]
        parent = parents[run]
    return run
