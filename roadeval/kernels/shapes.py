"""Compiled loops over masks: components and holes by runs, and many pixels at once as bits.

A run is a stretch of equal pixels in a row, from ``start`` up to but not including ``end``. A
mask that was opened and closed has a few of them a row, so that what is asked of its components
is asked of some thousand runs instead of all pixels.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

_compiled = njit(cache=True, nogil=True)
_inlined = njit(cache=True, nogil=True, inline="always")

Mask = npt.NDArray[np.uint8]
Bits = npt.NDArray[np.uint64]
Labels = npt.NDArray[np.int32]
Runs = npt.NDArray[np.int32]
Places = npt.NDArray[np.int64]


# --- Components and holes, by runs ----------------------------------------------------------------


@_compiled  # type: ignore[untyped-decorator]
def components(mask: Mask, connectivity: int) -> tuple[Labels, Runs, int]:
    """See `plain.components`."""
    rows, starts, ends = _runs(mask, True)
    parents = _joined(rows, starts, ends, 1 if connectivity == 8 else 0)
    labels = np.zeros(mask.shape, np.int32)
    runs = np.empty((len(starts), 4), np.int32)
    count = 0
    for y in range(len(mask)):
        for run in range(rows[y], rows[y + 1]):
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
            for x in range(starts[run], ends[run]):
                labels[y, x] = label
    return labels, runs, count


@_compiled  # type: ignore[untyped-decorator]
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


@_compiled  # type: ignore[untyped-decorator]
def keep_region(mask: Mask, patch: Mask) -> Mask:
    """See `plain.keep_region`."""
    rows, starts, ends = _runs(mask, True)
    parents = _joined(rows, starts, ends, 1)
    kept = np.zeros(mask.shape, np.uint8)
    if not len(parents):
        return kept
    areas = np.zeros(len(parents), np.int64)
    inside = np.zeros(len(parents), np.int64)
    for y in range(len(mask)):
        for run in range(rows[y], rows[y + 1]):
            areas[parents[run]] += ends[run] - starts[run]
            if patch.size:
                for x in range(starts[run], ends[run]):
                    inside[parents[run]] += patch[y, x] > 0
    # A component's own number is its first run's: of equals the first from the top is found.
    best = np.argmax(inside) if inside.any() else np.argmax(areas)
    for y in range(len(mask)):
        for run in range(rows[y], rows[y + 1]):
            if parents[run] == best:
                kept[y, starts[run] : ends[run]] = 1
    return kept


@_compiled  # type: ignore[untyped-decorator]
def fill_holes(mask: Mask) -> Mask:
    """See `plain.fill_holes`."""
    height, width = mask.shape
    rows, starts, ends = _runs(mask, False)
    parents = _joined(rows, starts, ends, 0)
    outside = np.zeros(len(parents), np.bool_)
    for y in range(height):
        for run in range(rows[y], rows[y + 1]):
            if y == 0 or y == height - 1 or starts[run] == 0 or ends[run] == width:
                outside[parents[run]] = True
    filled = np.ones(mask.shape, np.uint8)
    for y in range(height):
        for run in range(rows[y], rows[y + 1]):
            if outside[parents[run]]:
                filled[y, starts[run] : ends[run]] = 0
    return filled


@_compiled  # type: ignore[untyped-decorator]
def _runs(mask: Mask, inside: bool) -> tuple[Places, Runs, Runs]:
    """Find the runs of ones (or of zeros, if not ``inside``), row after row.

    Those of row y are numbered from ``rows[y]`` up to but not including ``rows[y + 1]``.
    """
    height, width = mask.shape
    rows = np.zeros(height + 1, np.int64)
    starts = np.empty(height * (width // 2 + 1), np.int32)
    ends = np.empty_like(starts)
    count = 0
    words = -(-width // 64)
    # A row's pixels in bytes and in bits, with at least one more, which is clear.
    row = np.zeros(64 * (words + 1), np.uint8)
    eights = row.view(np.uint64)
    for y in range(height):
        # Assigning a slice compiles to something fifteen times as slow.
        for x in range(width):
            row[x] = (mask[y, x] != 0) == inside
        before, running = np.uint64(0), False
        for word in range(words + 1):
            bits = np.uint64(0)
            for eight in range(8):
                # The product brings the lowest bits of eight bytes together in its highest byte.
                packed = (eights[8 * word + eight] * _GATHER) >> np.uint64(56)
                bits |= packed << np.uint64(8 * eight)
            turns = bits ^ (bits << np.uint64(1) | before)
            before = bits >> np.uint64(63)
            while turns:
                place = 64 * word + _lowest(turns)
                turns &= turns - np.uint64(1)
                if running:
                    ends[count] = place
                    count += 1
                else:
                    starts[count] = place
                running = not running
        rows[y + 1] = count
    return rows, starts[:count], ends[:count]


_GATHER = np.uint64(0x0102040810204080)


@intrinsic  # type: ignore[untyped-decorator]
def _lowest(_context: Any, _word: Any) -> Any:
    """Find the lowest set bit of a word that has one."""

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], cgutils.true_bit)

    return types.int64(types.uint64), build


@_compiled  # type: ignore[untyped-decorator]
def _joined(rows: Places, starts: Runs, ends: Runs, corner: int) -> Places:
    """Join runs of neighbouring rows that touch: of each run the first one of its component.

    With ``corner`` 1 they may touch by a corner (8-connected), with 0 by a side alone.
    """
    parents = np.arange(len(starts))
    for y in range(1, len(rows) - 1):
        above, here = rows[y - 1], rows[y]
        while above < rows[y] and here < rows[y + 1]:
            if starts[above] < ends[here] + corner and starts[here] < ends[above] + corner:
                a, b = _first(parents, above), _first(parents, here)
                parents[max(a, b)] = min(a, b)
            if ends[above] < ends[here]:
                above += 1
            else:
                here += 1
    for run in range(len(parents)):
        # A parent comes before its child, and is settled already.
        parents[run] = parents[parents[run]]
    return parents


@_inlined  # type: ignore[untyped-decorator]
def _first(parents: Places, run: int) -> int:
    while parents[run] != run:
        parents[run] = parents[parents[run]]
        run = parents[run]
    return run


# --- Bits: 64 pixels a word -----------------------------------------------------------------------


@intrinsic  # type: ignore[untyped-decorator]
def _ones(_context: Any, _word: Any) -> Any:
    """Count the set bits of a word, by the processor's own instruction where it has one."""

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])

    return types.uint64(types.uint64), build


@_compiled  # type: ignore[untyped-decorator]
def count_bits(masks: Bits, classes: Bits, regions: Bits) -> Places:
    """See `plain.count_bits`."""
    counts = np.zeros((len(masks), len(classes), len(regions)), np.int64)
    both = np.empty(masks.shape[1], np.uint64)
    for region in range(len(regions)):
        for kind in range(len(classes)):
            for word in range(len(both)):
                both[word] = regions[region, word] & classes[kind, word]
            for mask in range(len(masks)):
                row, total = masks[mask], np.uint64(0)
                for word in range(len(both)):
                    total += _ones(row[word] & both[word])
                counts[mask, kind, region] = total
    return counts


@_compiled  # type: ignore[untyped-decorator]
def grow(bits: Bits, reach: Places, width: int) -> Bits:
    """See `plain.grow`."""
    height, words = bits.shape
    grown = np.zeros_like(bits)
    # With a clear word at both ends, beside which nothing is to be asked.
    wide, spare = np.zeros(words + 2, np.uint64), np.zeros(words + 2, np.uint64)
    # Bits beyond the image's width stay clear.
    rest = np.uint64(width % 64)
    last = ~np.uint64(0) if rest == 0 else (np.uint64(1) << rest) - np.uint64(1)
    for y in range(height):
        if not bits[y].any():
            continue
        done = -1
        for away in range(len(reach)):
            if reach[away] != done:
                done = reach[away]
                for word in range(words):
                    wide[word + 1] = bits[y, word]
                _widen(wide, spare, done)
                wide[words] &= last
            for v in (y - away, y + away):
                if 0 <= v < height:
                    for word in range(words):
                        grown[v, word] |= wide[word + 1]
    return grown


@_compiled  # type: ignore[untyped-decorator]
def _widen(wide: Bits, spare: Bits, pixels: int) -> None:
    """Set every bit that lies within so many pixels of a set one, in few steps."""
    words = len(wide) - 2
    done = 0
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
