"""Colours of pixels: looked up in tables, and their distance from a mean (Eq. 2)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from roadeval.data.arrays import CodeTable, Matrix, Plane, Planes, Sums, Values, Vector, Words


def look_up_sum_min(planes: Planes, table: CodeTable) -> tuple[Plane, Sums]:
    """Look every pixel up by the sum and the minimum of its channels.

    Parameters
    ----------
    planes
        Red, green and blue, ``(H, W)`` uint8 each.
    table
        ``(766, 256)`` uint8, indexed by ``R + G + B`` and ``min(R, G, B)``.

    Returns
    -------
    codes, histogram
        ``(H, W)`` uint8, and ``(256,)`` int64: how often each code occurs.
    """
    codes = table[np.sum(planes, axis=0, dtype=np.int64), np.min(planes, axis=0)]
    return codes, np.bincount(codes.ravel(), minlength=256)


def mahalanobis(
    planes: Planes, mean: Vector, whitening: Matrix, greatest: float
) -> tuple[Values, Plane]:
    """Distance of Eq. 2, ``|W (x - m)|``, of every pixel.

    Parameters
    ----------
    planes
        Red, green and blue, ``(H, W)`` uint8 each.
    mean, whitening
        m, ``(3,)``, a colour in 0..255, and W, ``(3, 3)`` lower triangular: ``W^T W`` is the
        inverse covariance.
    greatest
        Of the square, up to which a pixel is near: a finite number.

    Returns
    -------
    distance, near
        ``(H, W)`` float32, computed in that precision; and ``(H, W)`` uint8, 1 near and 0 far,
        decided in float64.
    """
    near = _squared(planes, mean, whitening) <= greatest
    single = mean.astype(np.float32), whitening.astype(np.float32)
    distance: Values = np.sqrt(_squared(planes, *single))
    return distance, near.astype(np.uint8)


def _squared(
    planes: Planes, mean: npt.NDArray[np.floating], whitening: npt.NDArray[np.floating]
) -> npt.NDArray[np.floating]:
    """Compute ``|W (x - m)|^2`` in the precision of m and W."""
    r, g, b = (plane.astype(mean.dtype) - level for plane, level in zip(planes, mean, strict=True))
    first, second, third = whitening
    u = first[0] * r
    v = second[0] * r + second[1] * g
    w = third[0] * r + third[1] * g + third[2] * b
    squared: npt.NDArray[np.floating] = u * u + v * v + w * w
    return squared


def look_up_colours(planes: Planes, road: Words, left: Words) -> Plane:
    """Look every pixel up in a table over all colours, a bit each.

    Parameters
    ----------
    planes
        Red, green and blue, ``(H, W)`` uint8 each.
    road, left
        ``(2^18,)`` uint64 by the upper six bits of red, green and blue; of a word's bits the lower
        two of each tell which: similar colours, as an image has them side by side, share it.
        ``left`` may be empty.

    Returns
    -------
    numpy.ndarray
        ``(H, W)`` uint8: the bit in ``road``, and twice that in ``left``.
    """
    r, g, b = (plane.astype(np.int64) for plane in planes)
    word = (r >> 2) << 12 | (g >> 2) << 6 | b >> 2
    bit = ((r & 3) << 4 | (g & 3) << 2 | b & 3).astype(np.uint64)
    found: Plane = (road[word] >> bit & np.uint64(1)).astype(np.uint8)
    if len(left):
        found |= (left[word] >> bit & np.uint64(1)).astype(np.uint8) << 1
    return found
