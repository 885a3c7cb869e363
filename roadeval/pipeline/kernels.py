"""The loops over every pixel that no library offers in one pass, compiled.

Each kernel equals its NumPy twin in `plain` bit for bit; `fast` picks the compiled one where
compilation works, and the twin where it does not (no compiler support, nowhere to keep the
cache), so the results never depend on the machine.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

_compiled = njit(cache=True, nogil=True)

Codes = npt.NDArray[np.uint8]
Labels = npt.NDArray[np.int32]
Sums = npt.NDArray[np.int64]


@_compiled  # type: ignore[untyped-decorator]
def look_up_sum_min(
    image: npt.NDArray[np.uint8], table: Codes
) -> tuple[Codes, npt.NDArray[np.int64]]:
    """See `plain.look_up_sum_min`."""
    height, width, _ = image.shape
    codes = np.empty((height, width), np.uint8)
    histogram = np.zeros(256, np.int64)
    for y in range(height):
        for x in range(width):
            r, g, b = image[y, x, 0], image[y, x, 1], image[y, x, 2]
            code = table[np.int64(r) + np.int64(g) + np.int64(b), min(r, g, b)]
            codes[y, x] = code
            histogram[code] += 1
    return codes, histogram


@_compiled  # type: ignore[untyped-decorator]
def region_sums(
    image: npt.NDArray[np.uint8], labels: Labels, ring: Codes, count: int, width: int
) -> tuple[Sums, Sums]:
    """See `plain.region_sums`."""
    rows, columns = labels.shape
    inside = np.zeros((count, 7), np.int64)
    outside = np.zeros((count, 7), np.int64)
    # The last pixel that each component counted: one pixel counts once in a ring.
    last = np.full(count, -1, np.int64)
    for y in range(rows):
        for x in range(columns):
            label = labels[y, x]
            if label > 0:
                _add(inside[label], image[y, x])
            elif ring[y, x]:
                pixel = y * columns + x
                for v in range(max(y - width, 0), min(y + width + 1, rows)):
                    for u in range(max(x - width, 0), min(x + width + 1, columns)):
                        near = labels[v, u]
                        if near > 0 and last[near] != pixel:
                            last[near] = pixel
                            _add(outside[near], image[y, x])
    return inside, outside


@njit(cache=True, nogil=True, inline="always")  # type: ignore[untyped-decorator]
def _add(sums: Sums, colour: npt.NDArray[np.uint8]) -> None:
    sums[0] += 1
    for channel in range(3):
        value = np.int64(colour[channel])
        sums[1 + channel] += value
        sums[4 + channel] += value * value


@_compiled  # type: ignore[untyped-decorator]
def transfer(
    image: npt.NDArray[np.uint8],
    labels: Labels,
    source: npt.NDArray[np.float64],
    target: npt.NDArray[np.float64],
    gain: npt.NDArray[np.float64],
) -> npt.NDArray[np.uint8]:
    """See `plain.transfer`."""
    result = image.copy()
    rows, columns = labels.shape
    for y in range(rows):
        for x in range(columns):
            label = labels[y, x]
            if label > 0:
                for c in range(3):
                    value = target[label, c] + (image[y, x, c] - source[label, c]) * gain[label, c]
                    result[y, x, c] = np.uint8(min(max(np.rint(value), 0.0), 255.0))
    return result


@_compiled  # type: ignore[untyped-decorator]
def mahalanobis(
    image: npt.NDArray[np.uint8],
    mean: npt.NDArray[np.float64],
    precision: npt.NDArray[np.float64],
    greatest: float,
) -> tuple[npt.NDArray[np.float32], Codes]:
    """See `plain.mahalanobis`."""
    height, width, _ = image.shape
    distance = np.empty((height, width), np.float32)
    near = np.empty((height, width), np.uint8)
    away = np.empty((3, width), np.float64)
    # Colours taken apart, a row at a time: the loop over them then runs in vector instructions.
    squared = np.empty(width, np.float64)
    for y in range(height):
        for x in range(width):
            for channel in range(3):
                away[channel, x] = image[y, x, channel] - mean[channel]
        for x in range(width):
            r, g, b = away[0, x], away[1, x], away[2, x]
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
def areas(labels: Labels, count: int) -> npt.NDArray[np.int64]:
    """See `plain.areas`."""
    result = np.zeros(count, np.int64)
    for row in labels:
        for label in row:
            result[label] += 1
    return result


@_compiled  # type: ignore[untyped-decorator]
def look_up_colours(image: npt.NDArray[np.uint8], table: Codes) -> Codes:
    """See `plain.look_up_colours`."""
    height, width, _ = image.shape
    result = np.empty((height, width), np.uint8)
    for y in range(height):
        for x in range(width):
            result[y, x] = table[
                (np.int64(image[y, x, 0]) << 16)
                | (np.int64(image[y, x, 1]) << 8)
                | np.int64(image[y, x, 2])
            ]
    return result


@_compiled  # type: ignore[untyped-decorator]
def rectified_sum(
    features: npt.NDArray[np.float32],
    planes: npt.NDArray[np.float32],
    bias: npt.NDArray[np.float32],
    weights: npt.NDArray[np.float32],
) -> npt.NDArray[np.float32]:
    """See `plain.rectified_sum`."""
    pixels = features.shape[1]
    result = np.zeros(pixels, np.float32)
    # So many pixels at once stay in the nearest cache with all of their features.
    sides = np.empty(256, np.float32)
    for start in range(0, pixels, 256):
        part = result[start : start + 256]
        side = sides[: len(part)]
        for plane in range(len(bias)):
            side[:] = bias[plane]
            for feature in range(len(features)):
                _add_product(side, features[feature, start : start + 256], planes[plane, feature])
            for pixel in range(len(part)):
                part[pixel] += max(side[pixel], np.float32(0)) * weights[plane]
    return result


@njit(cache=True, nogil=True, inline="always")  # type: ignore[untyped-decorator]
def _add_product(
    total: npt.NDArray[np.float32], values: npt.NDArray[np.float32], factor: np.float32
) -> None:
    for index in range(len(total)):
        total[index] += values[index] * factor
