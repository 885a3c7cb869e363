"""Compiled loops over the pixels of an image: tables of colours, and the distance of Eq. 2."""

from __future__ import annotations

from typing import Any

import numpy as np

from roadeval.data.arrays import CodeTable, Matrix, Plane, Planes, Sums, Values, Vector, Words
from roadeval.kernels.compiler import compiled, inlined, part


@compiled
def look_up_sum_min(planes: Planes, table: CodeTable) -> tuple[Plane, Sums]:
    """See `plain.look_up_sum_min`."""
    reds, greens, blues = planes
    height, width = reds.shape
    codes = np.empty((height, width), np.uint8)
    # Four counters for each code, so that equal neighbours need not wait for each other.
    histograms = np.zeros((4, 256), np.int64)
    places = np.empty(width, np.int32)
    entries = table.ravel()
    for y in range(height):
        for x in range(width):
            r, g, b = np.int32(reds[y, x]), np.int32(greens[y, x]), np.int32(blues[y, x])
            places[x] = ((r + g + b) << 8) + min(r, g, b)
        for x in range(width):
            codes[y, x] = entries[places[x]]
        for x in range(width):
            histograms[x & 3, codes[y, x]] += 1
    for code in range(256):
        for counter in range(1, 4):
            histograms[0, code] += histograms[counter, code]
    return codes, histograms[0].copy()


@compiled
def mahalanobis(
    planes: Planes, mean: Vector, whitening: Matrix, greatest: float
) -> tuple[Values, Plane]:
    """See `plain.mahalanobis`.

    Twice as many numbers of single precision fit into a vector, and it decides nearly every pixel.
    Those that lie too close to the limit for it are decided in double precision.
    """
    reds, greens, blues = planes
    height, width = reds.shape
    distance = np.empty((height, width), np.float32)
    near = np.empty((height, width), np.uint8)
    linear = _linear(mean, whitening, np.float32)
    exact = _linear(mean, whitening, np.float64)
    limit = np.sqrt(greatest)
    error = _rounding(whitening, limit)
    surely, perhaps = np.float32(limit - error), np.float32(limit + error)
    for y in range(height):
        for x in range(width):
            r, g, b = np.float32(reds[y, x]), np.float32(greens[y, x]), np.float32(blues[y, x])
            distance[y, x] = np.sqrt(_squared(r, g, b, linear))
        undecided = np.uint8(0)
        for x in range(width):
            near[y, x] = distance[y, x] <= surely
            undecided |= near[y, x] ^ np.uint8(distance[y, x] <= perhaps)
        if undecided:
            for x in range(width):
                if surely < distance[y, x] <= perhaps:
                    r, g, b = reds[y, x], greens[y, x], blues[y, x]
                    near[y, x] = _squared(r, g, b, exact) <= greatest
    return distance, near


@part
def _rounding(whitening: Matrix, limit: float) -> float:
    """Return a bound on the rounding of a distance near the limit in single precision.

    A rounding is 2^-24 of a number. Each of the three components is off by six roundings of
    ``reach``, their norm by sqrt(3) times as much, and by three more of its own: 16 are enough.
    """
    reach = 0.0
    for row in range(3):
        total = abs(whitening[row, 0]) + abs(whitening[row, 1]) + abs(whitening[row, 2])
        reach = max(reach, 255.0 * total)
    return 16.0 * 2.0**-24 * (reach + limit)


@inlined
def _linear(mean: Vector, whitening: Matrix, kind: Any) -> Any:
    """Return the numbers of ``W (x - m)`` in a precision, one by one: they stay in registers."""
    return (
        (kind(mean[0]), kind(mean[1]), kind(mean[2])),
        (kind(whitening[0, 0]),),
        (kind(whitening[1, 0]), kind(whitening[1, 1])),
        (kind(whitening[2, 0]), kind(whitening[2, 1]), kind(whitening[2, 2])),
    )


@inlined
def _squared(red: Any, green: Any, blue: Any, linear: Any) -> Any:
    mean, first, second, third = linear
    r, g, b = red - mean[0], green - mean[1], blue - mean[2]
    u = first[0] * r
    v = second[0] * r + second[1] * g
    w = third[0] * r + third[1] * g + third[2] * b
    return u * u + v * v + w * w


@compiled
def look_up_colours(planes: Planes, road: Words, left: Words) -> Plane:
    """See `plain.look_up_colours`."""
    reds, greens, blues = planes
    height, width = reds.shape
    result = np.empty((height, width), np.uint8)
    # A row at a time: where its colours stand is found in vector instructions.
    words, bits = np.empty(width, np.int32), np.empty(width, np.uint8)
    for y in range(height):
        for x in range(width):
            r, g, b = np.int32(reds[y, x]), np.int32(greens[y, x]), np.int32(blues[y, x])
            words[x] = (r >> 2) << 12 | (g >> 2) << 6 | b >> 2
            bits[x] = (r & 3) << 4 | (g & 3) << 2 | b & 3
        for x in range(width):
            result[y, x] = road[np.uintp(words[x])] >> np.uint64(bits[x]) & np.uint64(1)
        if len(left):
            for x in range(width):
                still = left[np.uintp(words[x])] >> np.uint64(bits[x]) & np.uint64(1)
                result[y, x] |= np.uint8(still << np.uint64(1))
    return result
