"""The kernels as NumPy and OpenCV expressions: their definition, and a fallback without a compiler.

Each section is a C file in the folder ``c``.
"""

from __future__ import annotations

from typing import Any, Final

import cv2
import numpy as np

from roadeval.data import arrays, pack, unpack
from roadeval.data.arrays import Bits, Floats, Image, Masks, Plane, Planes, Runs, Sums, Values

_AROUND: Final[dict[str, Any]] = {"borderType": cv2.BORDER_CONSTANT, "borderValue": 0}
"""No bit is set around a mask."""
FAR: Final = 1 << 30
"""Distance of pixels that no path reaches; no distance is greater."""
STRAIGHT: Final = 5
ASLANT: Final = 7
"""Length of a step to a neighbour by a side and by a corner: 7/5 is the root of 2, less 1 %."""
LABEL_BITS: Final = (2, 4, 8)
"""Bits that a label of a PNG file may have here; with one bit it is a mask."""
LEAVES: Final = 32
"""Greatest number of leaves of a tree."""


# --- Colours of pixels: looked up in tables, and their distance from a mean (Eq. 2) ---------------


def look_up_sum_min(planes: Planes, table: Plane) -> tuple[Plane, Sums]:
    """Look every pixel up by the sum and the minimum of its channels.

    ``planes`` are red, green and blue, ``(H, W)`` uint8 each; ``table`` is ``(766, 256)`` uint8,
    indexed by ``R + G + B`` and ``min(R, G, B)``. Returned are the codes, ``(H, W)`` uint8, and how
    often each occurs, ``(256,)`` int64.
    """
    codes = table[np.sum(planes, axis=0, dtype=np.int64), np.min(planes, axis=0)]
    return codes, np.bincount(codes.ravel(), minlength=256)


def mahalanobis(
    planes: Planes, mean: Floats, whitening: Floats, greatest: float
) -> tuple[Values, Plane]:
    """Compute the distance of Eq. 2, ``|W (x - m)|``, of every pixel.

    ``planes`` are red, green and blue, ``(H, W)`` uint8 each; ``mean`` is m, ``(3,)``, a colour in
    0..255, and ``whitening`` W, ``(3, 3)`` lower triangular: ``W^T W`` is the inverse covariance.
    ``greatest`` is the greatest squared distance of a near pixel, a finite number. Returned are the
    distance, ``(H, W)`` float32, computed in that precision, and ``(H, W)`` uint8, 1 near and 0
    far, decided in float64.
    """
    near = _squared(planes, mean, whitening) <= greatest
    single = mean.astype(np.float32), whitening.astype(np.float32)
    return np.sqrt(_squared(planes, *single)), near.astype(np.uint8)


def _squared(planes: Planes, mean: Values, whitening: Values) -> Values:
    """Compute ``|W (x - m)|^2`` in the precision of m and W."""
    r, g, b = (plane.astype(mean.dtype) - level for plane, level in zip(planes, mean, strict=True))
    first, second, third = whitening
    u = first[0] * r
    v = second[0] * r + second[1] * g
    w = third[0] * r + third[1] * g + third[2] * b
    return u * u + v * v + w * w


def look_up_colours(planes: Planes, road: arrays.Words) -> Plane:
    """Look every pixel up in a table over all colours, a bit each.

    ``planes`` are red, green and blue, ``(H, W)`` uint8 each. ``road`` is ``(2^18,)`` uint64, a
    word for the upper six bits of red, green and blue, with a bit for the lower two of each:
    similar colours, which neighbours in an image have, share a word. Returned are the bits,
    ``(H, W)`` uint8.
    """
    r, g, b = (plane.astype(np.int64) for plane in planes)
    word = (r >> 2) << 12 | (g >> 2) << 6 | b >> 2
    bit = ((r & 3) << 4 | (g & 3) << 2 | b & 3).astype(np.uint64)
    return (road[word] >> bit & np.uint64(1)).astype(np.uint8)


# --- Masks of a bit a pixel: counted, dilated and eroded ------------------------------------------


def count_bits(masks: Bits, classes: Bits, regions: Bits) -> Sums:
    """Count the pixels of a class in a mask and in a region, for all combinations of these.

    ``masks``, ``classes`` and ``regions`` are ``(M, n)``, ``(C, n)`` and ``(R, n)`` uint64; the
    counts are ``(M, C, R)`` int64.
    """
    both = classes[:, None] & regions[None]
    counts = [np.bitwise_count(both & mask).sum(axis=2, dtype=np.int64) for mask in masks]
    return np.array(counts, np.int64).reshape(len(masks), *both.shape[:2])


def dilate(bits: Bits, reach: arrays.Reach, width: int) -> Bits:
    """Dilate a mask of ``width`` pixels a row by an element; nothing around it is set."""
    return pack(cv2.dilate(unpack(bits, width), _element(reach), **_AROUND))


def erode(bits: Bits, reach: arrays.Reach, width: int) -> Bits:
    """Erode a mask of ``width`` pixels a row by an element; nothing around it is set."""
    return pack(cv2.erode(unpack(bits, width), _element(reach), **_AROUND))


def _element(reach: arrays.Reach) -> Plane:
    side = 2 * max(len(reach) - 1, int(reach.max())) + 1
    rows, columns = np.abs(np.indices((side, side)) - side // 2)
    inside = (rows < len(reach)) & (columns <= reach[np.minimum(rows, len(reach) - 1)])
    return inside.astype(np.uint8)


# --- Colours of components and of their buffer rings summed up, and mapped (Eq. 10-11) ------------


def run_sums(planes: Planes, runs: Runs, count: int) -> Sums:
    """Sum the colours of every label's runs.

    ``planes`` are red, green and blue, ``(H, W)`` uint8 each; ``runs`` are ``(n, 4)`` int32, see
    `components`; ``count`` is the number of labels, background included. Returned are int64,
    ``(count, 7)``: pixels, sums of R, G, B, and sums of their squares.
    """
    y, x, label = _run_pixels(runs)
    return _sums(label, np.dstack(planes)[y, x], count)


def ring_sums(planes: Planes, runs: Runs, ring: Bits, count: int, width: int) -> Sums:
    """Sum the colours of every component's buffer ring (Eq. 10).

    ``planes``, ``runs`` and ``count`` are as in `run_sums`. ``ring`` is ``(H, words)``: the pixels
    outside the shadow that some dilation reaches. ``width`` is the number of 3x3 dilations: a ring
    pixel lies within this Chebyshev distance. Returned are ``(count, 7)`` int64, as in `run_sums`;
    a pixel counts once in each component that reaches it.
    """
    height, columns = planes[0].shape
    label, pixel = ring_pairs(paint(runs, height, columns), unpack(ring, columns), width)
    return _sums(label, np.dstack(planes).reshape(-1, 3)[pixel], count)


def ring_pairs(labels: arrays.Labels, ring: Plane, width: int) -> tuple[Sums, Sums]:
    """Return every ``(component, pixel)`` where the pixel lies in the component's ring (Eq. 10).

    ``labels`` and ``ring`` are ``(H, W)``, ``width`` is as in `ring_sums`. Pixels are flat indices;
    a pixel near two components occurs with both.
    """
    pixel = np.flatnonzero(ring)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(labels, width), [2 * width + 1] * 2)
    keys, (y, x) = np.empty(0, np.int64), np.nonzero(ring)
    for row in range(2 * width + 1):  # together the repetitions of a wide ring take much memory
        near = windows[y, x, row]
        inside = near > 0
        more = near[inside].astype(np.int64) * labels.size + pixel[np.nonzero(inside)[0]]
        keys = np.unique(np.concatenate([keys, more]))
    return keys // labels.size, keys % labels.size


def _sums(labels: arrays.Places, colours: Plane, count: int) -> Sums:
    values = colours.astype(np.float64)
    columns = np.column_stack([np.ones(len(values)), values, values**2]).T
    # Sums of 8-bit values and of their squares stay far below 2^53: float64 adds them exactly.
    sums = [np.bincount(labels, column, count) for column in columns]
    return np.stack(sums, axis=1).astype(np.int64)


def transfer(image: Image, runs: Runs, source: Floats, target: Floats, gain: Floats) -> Image:
    """Map each component's colours to ``target + (I - source) * gain``, rounded and clipped.

    ``runs`` are ``(n, 4)``, see `components`; ``source``, ``target`` and ``gain`` are
    ``(count, 3)`` float64, by label and channel. Returns ``(H, W, 3)`` uint8; other pixels stay
    unchanged.
    """
    result = image.copy()
    y, x, k = _run_pixels(runs)
    value = target[k] + (image[y, x] - source[k]) * gain[k]
    result[y, x] = np.clip(np.rint(value), 0, 255).astype(np.uint8)
    return result


# --- Cheapest paths from some pixels to all others ------------------------------------------------


def geodesics(cost: arrays.Costs, seeds: Plane, rounds: int) -> arrays.Distances:
    """Compute the length of the cheapest path from the seeds to each pixel.

    A path goes from neighbour to neighbour, by sides and corners. A step costs the sum of its two
    pixels' costs times `STRAIGHT` or `ASLANT`: ten times the integral of the cost along it [1]_.
    Rows are swept up and down in turn, paths within a row included, as raster scans do [2]_: a path
    that turns back up or down more than ``rounds`` times may be missed for a dearer one. Integers
    make the order of sums irrelevant. ``cost`` is ``(H, W)`` uint16, for a step of length 1.
    ``seeds`` are ``(H, W)`` uint8, nonzero where paths begin; a round is a sweep up and a sweep
    down. Returned are ``(H, W)`` int32, at most `FAR`.

    References
    ----------
    .. [1] P. J. Toivanen, New geodesic distance transforms for gray-scale images, Pattern
       Recognition Letters 17 (1996).
    .. [2] G. Borgefors, Distance transformations in digital images, CVGIP 34 (1986).
    """
    costs = cost.astype(np.int64)
    distance = np.where(seeds > 0, 0, FAR)
    for _ in range(rounds):
        _sweep(costs[::-1], distance[::-1])
        _sweep(costs, distance)
    return distance.astype(np.int32)


def _sweep(cost: Sums, distance: Sums) -> None:
    """Shorten paths, in place, by the steps from each row to the next and within it."""
    for y in range(len(cost)):
        if y > 0:
            _step(distance[y], cost[y], distance[y - 1], cost[y - 1], STRAIGHT)
            _step(distance[y, 1:], cost[y, 1:], distance[y - 1, :-1], cost[y - 1, :-1], ASLANT)
            _step(distance[y, :-1], cost[y, :-1], distance[y - 1, 1:], cost[y - 1, 1:], ASLANT)
        for way in (slice(None), slice(None, None, -1)):
            row, price = distance[y, way], cost[y, way]
            sums = np.concatenate([[0], np.cumsum(STRAIGHT * (price[1:] + price[:-1]))])
            row[:] = np.minimum.accumulate(row - sums) + sums


def _step(to: Sums, cost: Sums, start: Sums, other: Sums, length: int) -> None:
    np.minimum(to, start + length * (cost + other), out=to)


# --- Rows of a PNG file ---------------------------------------------------------------------------


def filter_rows(rows: Plane, step: int) -> Plane:
    """Subtract from each byte of a PNG file's rows its Paeth predictor (section 9 of the standard).

    The predictor is the byte to the left, above, or above the left one (the corner), whichever is
    nearest to ``left + above - corner``; the first in this order wins a tie. ``rows`` are
    ``(H, B)`` uint8, ``step`` is the number of bytes from a pixel to the next. Returned are
    ``(H, 1 + B)`` uint8, each row after its filter's number, 4. The differences are taken modulo
    256; bytes outside the image are 0.
    """
    height, size = rows.shape
    padded = np.zeros((1 + height, step + size), np.int16)
    padded[1:, step:] = rows
    left, above, corner = padded[1:, :size], padded[:-1, step:], padded[:-1, :size]
    choices = np.stack([left, above, corner])
    nearest = np.abs(left + above - corner - choices).argmin(axis=0)
    predicted = np.take_along_axis(choices, nearest[None], axis=0)[0].astype(np.uint8)
    return np.insert(rows - predicted, 0, np.uint8(4), axis=1)


def label_rows(labels: Plane, bits: int) -> Plane:
    """Pack labels, the leftmost into a byte's highest bits, without a filter.

    ``labels`` are ``(H, W)`` uint8; the lowest ``bits`` of each are packed, one of `LABEL_BITS`.
    Returned are ``(H, 1 + ceil(W * bits / 8))`` uint8, each row after its filter's number, 0.
    """
    single = np.unpackbits(labels[..., None], axis=2)[..., 8 - bits :]
    packed = np.packbits(single.reshape(len(labels), -1), axis=1)
    return np.insert(packed, 0, np.uint8(0), axis=1)


# --- Connected components of a mask, as stretches of rows (Eq. 9) ---------------------------------


def components(bits: Bits, width: int, connectivity: int) -> tuple[Runs, int]:
    """Label the connected components of a mask (Eq. 9).

    ``bits`` and ``width`` are the mask, see `roadeval.data.arrays`; ``connectivity`` is 8, or 4 if
    pixels that touch by a corner are not connected. Returned are the components' runs, their
    stretches of rows, ``(n, 4)`` int32: row, first column, column after the last, and label, row
    after row and from left to right; and the number of components. Labels count from 1, in the
    order of the components' first pixels.
    """
    count, labels = cv2.connectedComponents(unpack(bits, width), connectivity=connectivity)
    # The library numbers them by blocks of rows.
    used, first = np.unique(labels, return_index=True)
    order = used[used > 0][np.argsort(first[used > 0])]
    number = np.zeros(count, np.int32)
    number[order] = np.arange(1, count)
    return label_runs(number[labels]), count - 1


def paint(runs: Runs, height: int, width: int) -> arrays.Labels:
    """Return the ``(height, width)`` int32 image of `components`' labels, 0 outside."""
    labels = np.zeros((height, width), np.int32)
    y, x, label = _run_pixels(runs)
    labels[y, x] = label
    return labels


def label_runs(labels: arrays.Labels) -> Runs:
    """Return the runs of equal labels of an ``(H, W)`` int32 image, see `components`."""
    begins = np.ones((labels.shape[0], labels.shape[1] + 1), np.bool_)
    begins[:, 1:-1] = labels[:, 1:] != labels[:, :-1]
    y, x = np.nonzero(begins)
    runs = np.stack([y[:-1], x[:-1], x[1:]], axis=1)[y[:-1] == y[1:]]
    label = labels[runs[:, 0], runs[:, 1]]
    return np.column_stack([runs, label])[label > 0].astype(np.int32)


def _run_pixels(runs: Runs) -> tuple[Sums, Sums, Sums]:
    """Return row, column and label of every pixel of some runs, ``(n,)`` each."""
    y, start, end, label = runs.T.astype(np.int64)
    length = end - start
    first = np.repeat(start - np.cumsum(length) + length, length)
    return np.repeat(y, length), first + np.arange(len(first)), np.repeat(label, length)


def keep_region(bits: Bits, width: int) -> Bits:
    """Keep the largest 8-connected component of a mask; the first from the top wins a tie.

    An empty mask stays empty.
    """
    runs, _ = components(bits, width, 8)
    labels = paint(runs, len(bits), width)
    areas = np.bincount(labels.ravel(), minlength=2)[1:]
    return pack(labels == 1 + areas.argmax())


def fill_holes(bits: Bits, width: int) -> Bits:
    """Fill the holes of a mask: 4-connected sets of zeros that do not reach the image's border."""
    outside = np.pad(unpack(bits, width), 1)
    cv2.floodFill(outside, None, (0, 0), 2, flags=4)
    return pack(outside[1:-1, 1:-1] != 2)


# --- The sum of decision trees --------------------------------------------------------------------


def tree_sum(
    features: Values, feature: arrays.Indices, threshold: Values, leaves: Masks, values: Values
) -> Values:
    """Compute the sum of decision trees for each pixel, ``(n,)`` float32, in the trees' order.

    A tree's leaves are numbered from the left. A node with a feature above the threshold rules out
    the leaves on its left; the first leaf that no node has ruled out is the pixel's [1]_.
    ``features`` are ``(F, n)`` float32, for n pixels. ``feature``, ``threshold`` and ``leaves`` are
    ``(T, N)`` int32, float32 and uint32, for N nodes of T trees: a feature's place, the number that
    it is compared with, and a bit for each leaf that remains if it is above that; the highest bit
    is always set. ``values`` are ``(T, LEAVES)`` float32: the number that each leaf adds.

    References
    ----------
    .. [1] C. Lucchese et al., QuickScorer: A Fast Algorithm to Rank Documents with Additive
       Ensembles of Regression Trees, SIGIR 2015.
    """
    total: Values = np.zeros(features.shape[1], np.float32)
    for places, limits, masks, added in zip(feature, threshold, leaves, values, strict=True):
        above = features[places] > limits[:, None]
        left = np.bitwise_and.reduce(np.where(above, masks[:, None], ~np.uint32(0)), axis=0)
        first = np.bitwise_count((left & -left) - np.uint32(1))
        total += added[first]
    return total
