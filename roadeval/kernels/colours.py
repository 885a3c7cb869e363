"""Compiled loops over the pixels of an image: lookups, distances, outcomes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from roadeval.data.arrays import (
    FN,
    FP,
    IGNORED,
    Floats,
    Image,
    Plane,
    Planes,
    Sums,
    Table,
    Values,
    Words,
)

_compiled = njit(cache=True, nogil=True)
_inlined = njit(cache=True, nogil=True, inline="always")

_FEW = 8
"""Levels up to which so many comparisons are quicker than one look into a table."""


@_compiled  # type: ignore[untyped-decorator]
def look_up_sum_min(planes: Planes, table: Table) -> tuple[Plane, Sums]:
    """See `plain.look_up_sum_min`."""
    reds, greens, blues = planes
    height, width = reds.shape
    codes = np.empty((height, width), np.uint8)
    # Four counters a code, so that equal neighbours need not wait for each other.
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
    return codes, histograms.sum(axis=0)


@_compiled  # type: ignore[untyped-decorator]
def mahalanobis(
    planes: Planes,
    mean: Floats,
    whitening: Floats,
    greatest: float,
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
    # A rounding is 2^-24 of a number. Each of the three components is off by six roundings of
    # `reach`, their norm by sqrt(3) times as much, and by three more of its own: 16 are enough.
    reach = 255.0 * np.abs(whitening).sum(axis=1).max()
    error = 16.0 * 2.0**-24 * (reach + limit)
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


@_inlined  # type: ignore[untyped-decorator]
def _linear(mean: Floats, whitening: Floats, kind: Any) -> Any:
    """Give the numbers of ``W (x - m)`` in a precision, one by one: they stay in registers."""
    return (
        (kind(mean[0]), kind(mean[1]), kind(mean[2])),
        (kind(whitening[0, 0]),),
        (kind(whitening[1, 0]), kind(whitening[1, 1])),
        (kind(whitening[2, 0]), kind(whitening[2, 1]), kind(whitening[2, 2])),
    )


@_inlined  # type: ignore[untyped-decorator]
def _squared(red: Any, green: Any, blue: Any, linear: Any) -> Any:
    mean, first, second, third = linear
    r, g, b = red - mean[0], green - mean[1], blue - mean[2]
    u = first[0] * r
    v = second[0] * r + second[1] * g
    w = third[0] * r + third[1] * g + third[2] * b
    return u * u + v * v + w * w


@_compiled  # type: ignore[untyped-decorator]
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


@_compiled  # type: ignore[untyped-decorator]
def look_up_levels(plane: Plane, table: Table) -> Plane:
    """See `plain.look_up_levels`."""
    height, width = plane.shape
    result = np.empty((height, width), np.uint8)
    common = np.argmax(np.bincount(table))
    others = np.nonzero(table != common)[0].astype(np.uint8)
    for y in range(height):
        if len(others) > _FEW:
            for x in range(width):
                result[y, x] = table[plane[y, x]]
        else:
            # A comparison runs in vector instructions, and a look into a table does not.
            for x in range(width):
                result[y, x] = common
            for level in others:
                value = table[level]
                for x in range(width):
                    if plane[y, x] == level:
                        result[y, x] = value
    return result


@_compiled  # type: ignore[untyped-decorator]
def look_up_channels(image: Image, table: Table) -> Image:
    """See `plain.look_up_channels`."""
    height, width, _ = image.shape
    result = np.empty((height, width, 3), np.uint8)
    for y in range(height):
        for x in range(width):
            result[y, x, 0] = table[image[y, x, 0], 0]
            result[y, x, 1] = table[image[y, x, 1], 1]
            result[y, x, 2] = table[image[y, x, 2], 2]
    return result


@_compiled  # type: ignore[untyped-decorator]
def outcomes(mask: Plane, truth: Plane) -> Plane:
    """See `plain.outcomes`."""
    height, width = mask.shape
    result = np.empty((height, width), np.uint8)
    for y in range(height):
        for x in range(width):
            # TN and TP if the two agree, FP and FN if not.
            value = np.uint8(truth[y, x] + 2 * (truth[y, x] ^ mask[y, x]))
            result[y, x] = value if truth[y, x] <= 1 else IGNORED
    return result


@_compiled  # type: ignore[untyped-decorator]
def add_outcomes(errors: Plane, sums: Plane) -> None:
    """See `plain.add_outcomes`."""
    labelled, false_positives, false_negatives = sums
    for y in range(errors.shape[0]):
        for x in range(errors.shape[1]):
            labelled[y, x] += errors[y, x] != IGNORED
            false_positives[y, x] += errors[y, x] == FP
            false_negatives[y, x] += errors[y, x] == FN
