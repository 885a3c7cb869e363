"""Compiled loops over the pixels of an image: lookups, distances, outcomes."""

from __future__ import annotations

import numpy as np
from numba import njit

from roadeval.kernels.arrays import (
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
    precision: Floats,
    greatest: float,
) -> tuple[Values, Plane]:
    """See `plain.mahalanobis`."""
    reds, greens, blues = planes
    height, width = reds.shape
    distance = np.empty((height, width), np.float32)
    near = np.empty((height, width), np.uint8)
    # A row at a time: these loops then run in vector instructions.
    squared = np.empty(width, np.float64)
    for y in range(height):
        for x in range(width):
            r, g, b = reds[y, x] - mean[0], greens[y, x] - mean[1], blues[y, x] - mean[2]
            squared[x] = (
                precision[0, 0] * (r * r)
                + precision[1, 1] * (g * g)
                + precision[2, 2] * (b * b)
                + 2.0 * precision[0, 1] * (r * g)
                + 2.0 * precision[0, 2] * (r * b)
                + 2.0 * precision[1, 2] * (g * b)
            )
        for x in range(width):
            distance[y, x] = np.sqrt(np.float32(squared[x]))
            near[y, x] = squared[x] <= greatest
    return distance, near


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
