"""Compiled loops over the colours of an image: lookups, distances, sums and changes of colour."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

_compiled = njit(cache=True, nogil=True)
_inlined = njit(cache=True, nogil=True, inline="always")

Codes = npt.NDArray[np.uint8]
Labels = npt.NDArray[np.int32]
Runs = npt.NDArray[np.int32]
Row = npt.NDArray[np.int32]
Sums = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float32]
Planes = tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8], npt.NDArray[np.uint8]]

_NONE = np.int32(0x7FFFFFFF)
"""Greater than any label."""


@_compiled  # type: ignore[untyped-decorator]
def look_up_sum_min(planes: Planes, table: Codes) -> tuple[Codes, npt.NDArray[np.int64]]:
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
def run_sums(image: npt.NDArray[np.uint8], runs: Runs, count: int) -> Sums:
    """See `plain.run_sums`."""
    sums = np.zeros((count, 7), np.int64)
    for y, start, end, label in runs:
        r1 = g1 = b1 = r2 = g2 = b2 = np.int64(0)
        for x in range(start, end):
            r, g, b = np.int64(image[y, x, 0]), np.int64(image[y, x, 1]), np.int64(image[y, x, 2])
            r1, g1, b1 = r1 + r, g1 + g, b1 + b
            r2, g2, b2 = r2 + r * r, g2 + g * g, b2 + b * b
        for column, value in enumerate((end - start, r1, g1, b1, r2, g2, b2)):
            sums[label, column] += value
    return sums


@_compiled  # type: ignore[untyped-decorator]
def ring_sums(
    image: npt.NDArray[np.uint8], labels: Labels, ring: Codes, count: int, width: int
) -> Sums:
    """See `plain.ring_sums`."""
    columns = labels.shape[1]
    sums = np.zeros((count, 7), np.int64)
    # The last pixel that each component counted: one pixel counts once in a ring.
    last = np.full(count, -1, np.int64)
    greatest, least = np.empty(columns, np.int32), np.empty(columns, np.int32)
    spare = np.zeros(columns + 2 * width, np.int32), np.full(columns + 2 * width, _NONE)
    places = np.empty(columns, np.int64)
    for y in range(len(labels)):
        found = _places(ring[y], places)
        if not found:
            continue
        near = labels[max(y - width, 0) : y + width + 1]
        _bound(near, width, spare, greatest, least)
        for index in range(found):
            x = places[index]
            # Most pixels of a ring are near one component.
            if least[x] == greatest[x]:
                _add(sums, least[x], image, y, x)
            else:
                _add_each(sums, last, labels, image, (y, x, width))
    return sums


@_compiled  # type: ignore[untyped-decorator]
def _places(ring: Codes, places: npt.NDArray[np.int64]) -> int:
    """Note where a row is nonzero, and how often, without a branch that is hard to foresee."""
    count = 0
    for x in range(len(ring)):
        places[count] = x
        count += ring[x] != 0
    return count


@_compiled  # type: ignore[untyped-decorator]
def _bound(
    near: Labels,
    width: int,
    spare: tuple[Row, Row],
    greatest: Row,
    least: Row,
) -> None:
    """Give the greatest and the least label around each pixel of a row; 0 counts for neither.

    ``near`` are the rows around it, ``spare`` two rows with ``width`` pixels more on both sides,
    for the columns' own. Loops as simple as these run in vector instructions.
    """
    columns = len(least)
    high, low = spare
    above, below = high[width : width + columns], low[width : width + columns]
    for x in range(columns):
        above[x], below[x] = 0, _NONE
    for v in range(len(near)):
        row = near[v]
        for x in range(columns):
            above[x] = max(above[x], row[x])
        for x in range(columns):
            below[x] = min(below[x], row[x] if row[x] > 0 else _NONE)
    for x in range(columns):
        greatest[x], least[x] = high[x], low[x]
    for shift in range(1, 2 * width + 1):
        for x in range(columns):
            greatest[x] = max(greatest[x], high[x + shift])
        for x in range(columns):
            least[x] = min(least[x], low[x + shift])


@_compiled  # type: ignore[untyped-decorator]
def _add_each(
    sums: Sums,
    last: npt.NDArray[np.int64],
    labels: Labels,
    image: npt.NDArray[np.uint8],
    place: tuple[int, int, int],
) -> None:
    """Add a ring's pixel once to every component within ``width`` of ``place``: (y, x, width)."""
    y, x, width = place
    rows, columns = labels.shape
    pixel = y * columns + x
    for v in range(max(y - width, 0), min(y + width + 1, rows)):
        for u in range(max(x - width, 0), min(x + width + 1, columns)):
            label = labels[v, u]
            if label > 0 and last[label] != pixel:
                last[label] = pixel
                _add(sums, label, image, y, x)


@_inlined  # type: ignore[untyped-decorator]
def _add(sums: Sums, label: int, image: npt.NDArray[np.uint8], y: int, x: int) -> None:
    # By indices: a view of an array has an owner to be counted, which takes longer than the sum.
    sums[label, 0] += 1
    for channel in range(3):
        value = np.int64(image[y, x, channel])
        sums[label, 1 + channel] += value
        sums[label, 4 + channel] += value * value


@_compiled  # type: ignore[untyped-decorator]
def transfer(
    image: npt.NDArray[np.uint8],
    runs: Runs,
    source: npt.NDArray[np.float64],
    target: npt.NDArray[np.float64],
    gain: npt.NDArray[np.float64],
) -> npt.NDArray[np.uint8]:
    """See `plain.transfer`."""
    result = image.copy()
    # What a component makes of a level is the same for all its pixels: a large one is tabulated.
    pixels = np.zeros(len(source), np.int64)
    for _, start, end, label in runs:
        pixels[label] += end - start
    place = np.cumsum(pixels > 256) - 1
    tables = np.empty((place[-1] + 1, 256, 3), np.uint8)
    for k in range(len(source)):
        if pixels[k] > 256:
            for level in range(256):
                for c in range(3):
                    tables[place[k], level, c] = _moved(
                        level, source[k, c], target[k, c], gain[k, c]
                    )
    for y, start, end, k in runs:
        table = place[k]
        for x in range(start, end):
            for c in range(3):
                level = image[y, x, c]
                result[y, x, c] = (
                    tables[table, level, c]
                    if pixels[k] > 256
                    else _moved(level, source[k, c], target[k, c], gain[k, c])
                )
    return result


@_inlined  # type: ignore[untyped-decorator]
def _moved(level: int, source: float, target: float, gain: float) -> np.uint8:
    return np.uint8(min(max(np.rint(target + (level - source) * gain), 0.0), 255.0))


@_compiled  # type: ignore[untyped-decorator]
def mahalanobis(
    planes: Planes,
    mean: npt.NDArray[np.float64],
    precision: npt.NDArray[np.float64],
    greatest: float,
) -> tuple[npt.NDArray[np.float32], Codes]:
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
    # So many pixels at once stay in a near cache with all of their features.
    sides = np.empty(1024, np.float32)
    for start in range(0, pixels, 1024):
        part = result[start : start + 1024]
        side = sides[: len(part)]
        for plane in range(len(bias)):
            for pixel in range(len(side)):
                side[pixel] = bias[plane]
            # Three at once, added in their order: the sums are read and written a third as often.
            whole = len(features) // 3 * 3
            for feature in range(0, whole, 3):
                _add_three(side, features, feature, start, planes[plane])
            for feature in range(whole, len(features)):
                _add_one(side, features, feature, start, planes[plane])
            _add_rectified(part, side, weights[plane])
    return result


@_compiled  # type: ignore[untyped-decorator]
def _add_three(total: Floats, features: Floats, first: int, start: int, slopes: Floats) -> None:
    a = features[first, start : start + len(total)]
    b = features[first + 1, start : start + len(total)]
    c = features[first + 2, start : start + len(total)]
    s, t, u = slopes[first], slopes[first + 1], slopes[first + 2]
    for index in range(len(total)):
        total[index] = total[index] + a[index] * s + b[index] * t + c[index] * u


@_compiled  # type: ignore[untyped-decorator]
def _add_one(total: Floats, features: Floats, feature: int, start: int, slopes: Floats) -> None:
    values, slope = features[feature, start : start + len(total)], slopes[feature]
    for index in range(len(total)):
        total[index] += values[index] * slope


@_compiled  # type: ignore[untyped-decorator]
def _add_rectified(total: Floats, side: Floats, weight: np.float32) -> None:
    for index in range(len(total)):
        total[index] += max(side[index], np.float32(0)) * weight


@_compiled  # type: ignore[untyped-decorator]
def outcomes(mask: Codes, truth: Codes, ignored: int) -> Codes:
    """See `plain.outcomes`."""
    height, width = mask.shape
    result = np.empty((height, width), np.uint8)
    for y in range(height):
        for x in range(width):
            value = np.uint8(truth[y, x] + 2 * (truth[y, x] ^ mask[y, x]))
            result[y, x] = value if truth[y, x] <= 1 else ignored
    return result


@_compiled  # type: ignore[untyped-decorator]
def add_outcomes(errors: Codes, ignored: int, sums: Codes) -> None:
    """See `plain.add_outcomes`."""
    labelled, false_positives, false_negatives = sums
    for y in range(errors.shape[0]):
        for x in range(errors.shape[1]):
            labelled[y, x] += errors[y, x] != ignored
            false_positives[y, x] += errors[y, x] == 2
            false_negatives[y, x] += errors[y, x] == 3
