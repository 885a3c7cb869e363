"""The compiled kernels, by the names of their twins in `plain`.

The loops are in C, in the folder ``c``; the library is built when the package is installed. Here
stands what each takes. Arrays are checked for their type, dimensions and order (an `ArgumentError`
of `ctypes`, a `TypeError` for what is no array), sizes are taken from them, and what a loop writes
is allocated. While it runs the interpreter lock is released.
"""

from __future__ import annotations

import ctypes
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data.arrays import (
    Bits,
    CodeTable,
    Image,
    Labels,
    Matrix,
    Plane,
    Planes,
    Reach,
    Runs,
    Sums,
    Values,
    Vector,
    Words,
)

__all__ = [
    "components",
    "count_bits",
    "fill_holes",
    "grow",
    "keep_region",
    "label_runs",
    "look_up_colours",
    "look_up_sum_min",
    "mahalanobis",
    "paint",
    "rectified_sum",
    "ring_sums",
    "run_sums",
    "transfer",
]

TABLED: Final = 256
"""As in ``c/compensation.c``: components of more pixels have a table of levels."""

BLOCK: Final = 512
"""Pixels at a time, as in ``c/rectified.c``."""

# --- The library ----------------------------------------------------------------------------------


def _library() -> ctypes.CDLL:
    """Load the library, and declare what its loops take."""
    from roadeval.kernels import _loops

    library = ctypes.CDLL(_loops.__file__)
    for name, taken in _TAKEN.items():
        loop = getattr(library, name)
        loop.argtypes, loop.restype = [_KINDS[each] for each in taken], ctypes.c_int64
    return library


_KINDS: Final = {"@": ctypes.c_void_p, "n": ctypes.c_int64, "?": ctypes.c_int, "d": ctypes.c_double}
_TAKEN: Final = {
    "components": "@nn?@@@@@",
    "count_bits": "@n@n@nn@@",
    "fill_holes": "@nn@@@@@@",
    "grow": "@nn@n?@@@@",
    "keep_region": "@nn@@@@@@@",
    "label_runs": "@nn@",
    "look_up_colours": "@@@nn@@@@@",
    "look_up_sum_min": "@@@nn@@@@",
    "mahalanobis": "@@@nn@@d@@",
    "paint": "@nn@",
    "rectified_sum": "@nn@@@n@@",
    "ring_sums": "@@@nn@@@nn@@@",
    "run_sums": "@@@n@n@",
    "transfer": "@n@n@@@n@@",
}
"""What each loop takes, in order: the address of an array, a size, a flag, a number."""

_LOOPS: Final = _library()


class _Kind:
    """A kind of arrays that a loop reads.

    Parameters
    ----------
    dtype, dimensions
        Of its arrays, which are C-contiguous.
    """

    def __init__(self, dtype: npt.DTypeLike, dimensions: int) -> None:
        self._dtype, self._dimensions = np.dtype(dtype), dimensions

    def __call__(self, array: npt.NDArray[Any]) -> int:
        """Return an array's address; a `TypeError` if it is of another kind."""
        right = array.dtype == self._dtype and array.ndim == self._dimensions
        if not (right and array.flags.c_contiguous):
            raise TypeError(
                f"{array.ndim}-dimensional {array.dtype} where a C-contiguous "
                f"{self._dimensions}-dimensional {self._dtype} is needed"
            )
        return _address(array)

    def unless_empty(self, array: npt.NDArray[Any]) -> int | None:
        return self(array) if array.size else None


_IMAGE, _PLANE = _Kind(np.uint8, 3), _Kind(np.uint8, 2)
_RUNS = _LABELS = _Kind(np.int32, 2)
_BITS, _WORDS = _Kind(np.uint64, 2), _Kind(np.uint64, 1)
_REACH = _Kind(np.int64, 1)
_VECTOR, _MATRIX = _Kind(np.float64, 1), _Kind(np.float64, 2)
_VALUES, _VALUE_ROWS = _Kind(np.float32, 1), _Kind(np.float32, 2)


def _address(array: npt.NDArray[Any]) -> int:
    """Return the address of an array that is known to be of the right kind."""
    return array.ctypes.data


def _addresses(*arrays: npt.NDArray[Any]) -> tuple[int, ...]:
    return tuple(array.ctypes.data for array in arrays)


def _channels(planes: Planes) -> tuple[int, ...]:
    """Return the addresses of an image's planes."""
    _shapes_agree(*planes)
    return tuple(map(_PLANE, planes))


def _shapes_agree(*arrays: Any) -> None:
    """Refuse arrays of different shapes, which a loop walks with one index."""
    if len({array.shape for array in arrays}) > 1:
        raise ValueError(f"arrays of different shapes: {[array.shape for array in arrays]}")


# --- Colours --------------------------------------------------------------------------------------


def look_up_sum_min(planes: Planes, table: CodeTable) -> tuple[Plane, Sums]:
    """See `plain.look_up_sum_min`."""
    height, width = planes[0].shape
    codes, histogram = np.empty((height, width), np.uint8), np.empty(256, np.int64)
    row = np.empty(width, np.int32)
    written = _addresses(codes, histogram, row)
    _LOOPS.look_up_sum_min(*_channels(planes), height, width, _PLANE(table), *written)
    return codes, histogram


def mahalanobis(
    planes: Planes, mean: Vector, whitening: Matrix, greatest: float
) -> tuple[Values, Plane]:
    """See `plain.mahalanobis`."""
    shape = planes[0].shape
    distance, near = np.empty(shape, np.float32), np.empty(shape, np.uint8)
    given = _VECTOR(mean), _MATRIX(whitening), greatest
    _LOOPS.mahalanobis(*_channels(planes), *shape, *given, *_addresses(distance, near))
    return distance, near


def look_up_colours(planes: Planes, road: Words, left: Words) -> Plane:
    """See `plain.look_up_colours`."""
    height, width = planes[0].shape
    result = np.empty((height, width), np.uint8)
    words, bits = np.empty(width, np.int32), np.empty(width, np.uint8)
    tables = _WORDS(road), _WORDS.unless_empty(left)
    written = _addresses(result, words, bits)
    _LOOPS.look_up_colours(*_channels(planes), height, width, *tables, *written)
    return result


# --- Components -----------------------------------------------------------------------------------


def run_sums(planes: Planes, runs: Runs, count: int) -> Sums:
    """See `plain.run_sums`."""
    width = planes[0].shape[1]
    sums = np.zeros((count, 7), np.int64)
    _LOOPS.run_sums(*_channels(planes), width, _RUNS(runs), len(runs), _address(sums))
    return sums


def ring_sums(planes: Planes, runs: Runs, ring: Bits, count: int, width: int) -> Sums:
    """See `plain.ring_sums`."""
    height, columns = planes[0].shape
    _require_width(ring, columns)
    sums, reached = np.zeros((count, 7), np.int64), np.zeros(count, np.int64)
    first = np.full(height + 2 * width + 1, len(runs))
    first[: width + 1] = 0
    first[width + 1 : height + width + 1] = np.bincount(runs[:, 0], minlength=height).cumsum()
    merge = np.empty(3 * (2 * width + 1), np.int64)
    _LOOPS.ring_sums(
        *(*_channels(planes), height, columns, _RUNS(runs), _address(first)),
        *(_BITS(ring), ring.shape[1], width, *_addresses(sums, reached, merge)),
    )
    return sums


def transfer(image: Image, runs: Runs, source: Matrix, target: Matrix, gain: Matrix) -> Image:
    """See `plain.transfer`."""
    _shapes_agree(source, target, gain)
    height, width, _ = image.shape
    result, count = image.copy(), len(source)
    pixels = np.zeros(count, np.int64)
    tables = np.empty(768 * min(count, height * width // TABLED), np.uint8)
    linear = (*map(_MATRIX, (source, target, gain)), count)
    written = _addresses(pixels, tables)
    _LOOPS.transfer(_IMAGE(result), width, _RUNS(runs), len(runs), *linear, *written)
    return result


def paint(runs: Runs, height: int, width: int) -> Labels:
    """See `plain.paint`."""
    labels = np.zeros((height, width), np.int32)
    _LOOPS.paint(_RUNS(runs), len(runs), width, _address(labels))
    return labels


def label_runs(labels: Labels) -> Runs:
    """See `plain.label_runs`."""
    height, width = labels.shape
    runs = np.empty((height * width, 4), np.int32)
    count = _LOOPS.label_runs(_LABELS(labels), height, width, _address(runs))
    return runs[:count].copy()


# --- Masks ----------------------------------------------------------------------------------------


def components(bits: Bits, width: int, connectivity: int) -> tuple[Runs, int]:
    """See `plain.components`."""
    room = _room_for_runs(bits, width)
    runs = np.empty((len(room[1]), 4), np.int32)
    given = _BITS(bits), len(bits), width, connectivity == 8
    count = _LOOPS.components(*given, *_addresses(*room, runs))
    return runs[: room[0][-1]].copy(), count


def keep_region(bits: Bits, width: int, patch: Plane) -> Bits:
    """See `plain.keep_region`."""
    if patch.size and patch.shape != (len(bits), width):
        raise ValueError(f"patch of shape {patch.shape} for a mask of {(len(bits), width)}")
    room, kept = _room_for_runs(bits, width), np.zeros_like(bits)
    votes = np.empty_like(room[3])
    given = _BITS(bits), len(bits), width, _PLANE.unless_empty(patch)
    _LOOPS.keep_region(*given, *_addresses(*room, votes, kept))
    return kept


def fill_holes(bits: Bits, width: int) -> Bits:
    """See `plain.fill_holes`."""
    room, filled = _room_for_runs(bits, width), bits.copy()
    outside = np.zeros(len(room[3]), np.uint8)
    _LOOPS.fill_holes(_BITS(bits), len(bits), width, *_addresses(*room, outside, filled))
    return filled


def _room_for_runs(bits: Bits, width: int) -> tuple[npt.NDArray[Any], ...]:
    """Return arrays for as many runs as a mask can have: see ``c/runs.c``."""
    _require_width(bits, width)
    most = len(bits) * (width // 2 + 1)
    return (
        np.empty(len(bits) + 1, np.int64),
        np.empty(most, np.int32),
        np.empty(most, np.int32),
        np.empty(most, np.int64),
    )


def _require_width(bits: Bits, width: int) -> None:
    if bits.shape[1] != -(-width // 64):
        raise ValueError(f"{bits.shape[1]} words a row for a width of {width}")


def count_bits(masks: Bits, classes: Bits, regions: Bits) -> Sums:
    """See `plain.count_bits`."""
    _shapes_agree(masks[0:0], classes[0:0], regions[0:0])
    words = masks.shape[1]
    counts = np.empty((len(masks), len(classes), len(regions)), np.int64)
    both = np.empty(words, np.uint64)
    given = [size for each in (masks, classes, regions) for size in (_BITS(each), len(each))]
    _LOOPS.count_bits(*given, words, *_addresses(counts, both))
    return counts


def grow(bits: Bits, reach: Reach, width: int, outside: bool) -> Bits:
    """See `plain.grow`."""
    _require_width(bits, width)
    height, words = bits.shape
    size = 1 + height * (words + 1)
    wide, spare, grown = (
        np.empty(size, np.uint64),
        np.empty(size, np.uint64),
        np.zeros(size, np.uint64),
    )
    result = np.empty((height, words), np.uint64)
    given = _BITS(bits), height, width, _REACH(reach), len(reach), outside
    _LOOPS.grow(*given, *_addresses(wide, spare, grown, result))
    return result


# --- Decision -------------------------------------------------------------------------------------


def rectified_sum(
    features: tuple[Values, ...], planes: Values, bias: Values, weights: Values
) -> Values:
    """See `plain.rectified_sum`."""
    _shapes_agree(*features)
    count = len(features)
    if planes.shape != (len(bias), count) or bias.shape != weights.shape:
        raise ValueError(f"planes of shape {planes.shape} for {count} features")
    planes, bias, weights = _in_pairs(planes), _in_pairs(bias), _in_pairs(weights)
    result, block = np.empty(len(features[0]), np.float32), np.empty(count * BLOCK, np.float32)
    addresses = (ctypes.c_void_p * count)(*map(_VALUES, features))
    given = _VALUE_ROWS(planes), _VALUES(bias), _VALUES(weights), len(bias)
    _LOOPS.rectified_sum(addresses, count, len(result), *given, *_addresses(block, result))
    return result


def _in_pairs(values: Values) -> Values:
    """Return an even number of planes: what a plane of zeros adds to the sum is 0."""
    return values if len(values) % 2 == 0 else np.concatenate([values, np.zeros_like(values[:1])])
