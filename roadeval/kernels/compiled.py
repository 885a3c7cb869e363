"""The compiled kernels, by the names of their twins in `plain`.

The loops are in C, in the folder ``c``, and built when the package is installed. The functions here
allocate the arrays that a loop writes. They raise a `ValueError` for shapes that do not fit
together, and a `TypeError` for an array of a wrong type, dimension or order. Rows, columns and
labels in runs are not checked: they come from `components` of an image of the same size.
"""

from __future__ import annotations

from collections.abc import Callable
from inspect import isfunction
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import arrays
from roadeval.data.arrays import Bits, Floats, Image, Masks, Plane, Planes, Runs, Sums, Values
from roadeval.kernels import _loops, plain

TABLED: Final = 256
"""Components of more pixels have a table of levels, as in ``c/compensation.c``."""
COLOUR_WORDS: Final = 1 << 18
"""Words of a table over all colours, 64 colours each."""
BLOCK: Final = 256
"""Pixels at a time, as in ``c/trees.c``."""


def _shape(*arrays: npt.NDArray[Any]) -> tuple[int, ...]:
    """Return the common shape of arrays; a `ValueError` if there is none."""
    shape = arrays[0].shape
    if any(array.shape != shape for array in arrays):
        raise ValueError(f"arrays of different shapes: {[array.shape for array in arrays]}")
    return shape


def _require(array: npt.NDArray[Any], *shape: int) -> None:
    """Raise a `ValueError` if an array has another shape."""
    if array.shape != shape:
        raise ValueError(f"an array of shape {array.shape}, not {shape}")


def look_up_sum_min(planes: Planes, table: Plane) -> tuple[Plane, Sums]:
    """Look every pixel up by the sum and the minimum of its channels."""
    _require(table, 766, 256)
    height, width = _shape(*planes)
    codes, histogram = np.empty((height, width), np.uint8), np.empty(256, np.int64)
    row = np.empty(width, np.int32)
    _loops.look_up_sum_min(*planes, height, width, table, codes, histogram, row)
    return codes, histogram


def mahalanobis(
    planes: Planes, mean: Floats, whitening: Floats, greatest: float
) -> tuple[Values, Plane]:
    """Compute the distance of Eq. 2 of every pixel, and which pixels are near."""
    _require(mean, 3)
    _require(whitening, 3, 3)
    shape = _shape(*planes)
    distance, near = np.empty(shape, np.float32), np.empty(shape, np.uint8)
    _loops.mahalanobis(*planes, *shape, mean, whitening, greatest, distance, near)
    return distance, near


def look_up_colours(planes: Planes, road: arrays.Words) -> Plane:
    """Look every pixel up in a table over all colours, a bit each."""
    _require(road, COLOUR_WORDS)
    height, width = _shape(*planes)
    result = np.empty((height, width), np.uint8)
    room = np.empty(width, np.int32), np.empty(width, np.uint8)
    _loops.look_up_colours(*planes, height, width, road, result, *room)
    return result


def run_sums(planes: Planes, runs: Runs, count: int) -> Sums:
    """Sum the colours of the runs of every label."""
    _require(runs, len(runs), 4)
    _, width = _shape(*planes)
    sums = np.zeros((count, 7), np.int64)
    _loops.run_sums(*planes, width, runs, len(runs), sums)
    return sums


def ring_sums(planes: Planes, runs: Runs, ring: Bits, count: int, width: int) -> Sums:
    """Sum the colours of every component's buffer ring (Eq. 10)."""
    _require(runs, len(runs), 4)
    height, columns = _shape(*planes)
    _require(ring, height, -(-columns // 64))
    sums, reached = np.zeros((count, 7), np.int64), np.zeros(count, np.int64)
    first = np.searchsorted(runs[:, 0], np.arange(-width, height + width + 1))
    merge = np.empty(3 * (2 * width + 1), np.int64)
    of_runs, of_ring = (runs, first), (ring, ring.shape[1], width)
    _loops.ring_sums(*planes, height, columns, *of_runs, *of_ring, sums, reached, merge)
    return sums


def transfer(image: Image, runs: Runs, source: Floats, target: Floats, gain: Floats) -> Image:
    """Map the colours of each component to a target, rounded and clipped."""
    _require(runs, len(runs), 4)
    count = len(gain)
    _require(gain, count, 3)
    _shape(source, target, gain)
    height, width, _ = image.shape
    result = image.copy()
    pixels = np.zeros(count, np.int64)
    tables = np.empty(768 * min(count, height * width // TABLED), np.uint8)
    linear = source, target, gain, count
    _loops.transfer(result, width, runs, len(runs), *linear, pixels, tables)
    return result


def components(bits: Bits, width: int, connectivity: int) -> tuple[Runs, int]:
    """Label the connected components of a mask (Eq. 9)."""
    room = _room_for_runs(bits, width)
    runs = np.empty((len(room[1]), 4), np.int32)
    count = _loops.components(bits, len(bits), width, connectivity == 8, *room, runs)
    return runs[: room[0][-1]].copy(), count


def keep_region(bits: Bits, width: int) -> Bits:
    """Keep the largest 8-connected component of a mask."""
    room, region = _room_for_runs(bits, width), np.zeros_like(bits)
    votes = np.zeros_like(room[3])
    _loops.keep_region(bits, len(bits), width, *room, votes, region)
    return region


def fill_holes(bits: Bits, width: int) -> Bits:
    """Fill the holes of a mask."""
    room, filled = _room_for_runs(bits, width), bits.copy()
    outside = np.zeros(len(room[3]), np.uint8)
    _loops.fill_holes(bits, len(bits), width, *room, outside, filled)
    return filled


def _room_for_runs(bits: Bits, width: int) -> tuple[npt.NDArray[Any], ...]:
    """Return arrays for as many runs as a mask can have: see ``c/runs.c``."""
    _require(bits, len(bits), -(-width // 64))
    most = len(bits) * (width // 2 + 1)
    return (
        np.empty(len(bits) + 1, np.int64),
        np.empty(most, np.int32),
        np.empty(most, np.int32),
        np.empty(most, np.int64),
    )


def count_bits(masks: Bits, classes: Bits, regions: Bits) -> Sums:
    """Count pixels by mask, class and region."""
    _, words = _shape(masks[:0], classes[:0], regions[:0])
    counts = np.empty((len(masks), len(classes), len(regions)), np.int64)
    sized = masks, len(masks), classes, len(classes), regions, len(regions)
    _loops.count_bits(*sized, words, counts, np.empty(words, np.uint64))
    return counts


def dilate(bits: Bits, reach: arrays.Reach, width: int) -> Bits:
    """Dilate a mask by an element."""
    return _by_element(_loops.dilate, bits, reach, width)


def erode(bits: Bits, reach: arrays.Reach, width: int) -> Bits:
    """Erode a mask by an element."""
    return _by_element(_loops.erode, bits, reach, width)


def _by_element(loop: Callable[..., int], bits: Bits, reach: arrays.Reach, width: int) -> Bits:
    _require(bits, len(bits), -(-width // 64))
    if not len(reach):
        raise ValueError("an element without rows")
    height, words = bits.shape
    room = np.empty(3 * (1 + height * (words + 1)), np.uint64)
    result = np.empty((height, words), np.uint64)
    loop(bits, height, width, reach, len(reach), room, result)
    return result


def geodesics(cost: arrays.Costs, seeds: Plane, rounds: int) -> arrays.Distances:
    """Compute the length of the cheapest path from the seeds to each pixel."""
    shape = _shape(cost, seeds)
    distance = np.empty(shape, np.int32)
    _loops.geodesics(cost, seeds, *shape, rounds, distance)
    return distance


def tree_sum(
    features: Values, feature: arrays.Indices, threshold: Values, leaves: Masks, values: Values
) -> Values:
    """Compute the sum of decision trees for each pixel."""
    count, pixels = features.shape
    trees, nodes = _shape(feature, threshold, leaves)
    _require(values, trees, plain.LEAVES)
    result, block = np.empty(pixels, np.float32), np.zeros(count * BLOCK, np.float32)
    sized = features, count, pixels
    _loops.tree_sum(*sized, feature, threshold, leaves, values, trees, nodes, block, result)
    return result


def filter_rows(rows: Plane, step: int) -> Plane:
    """Subtract the Paeth predictor from each byte of the rows of a PNG file."""
    height, width = rows.shape
    lines = np.empty((height, 1 + width), np.uint8)
    _loops.filter_rows(rows, height, width, step, lines)
    return lines


def label_rows(labels: Plane, bits: int) -> Plane:
    """Pack labels, the leftmost into a byte's highest bits."""
    if bits not in plain.LABEL_BITS:
        raise ValueError(f"labels of {bits} bits")
    height, width = labels.shape
    lines = np.empty((height, 1 + -(-width * bits // 8)), np.uint8)
    _loops.label_rows(labels, height, width, bits, lines)
    return lines


LOOPS: Final = [
    name
    for name, value in vars().items()
    if isfunction(value) and value.__module__ == __name__ and name[0] != "_"
]
if lacking := [name for name in LOOPS if not hasattr(_loops, name)]:
    # The checkout was updated, but not installed again.
    raise ImportError(f"the compiled loops are older than this file: no {', '.join(lacking)}")
