"""Colours of components and of their buffer rings summed up, and mapped (Eq. 10-11)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from roadeval.data.arrays import Bits, Image, Matrix, Planes, Runs, Sums
from roadeval.data.packed import unpack
from roadeval.kernels.plain.runs import paint, run_pixels


def run_sums(planes: Planes, runs: Runs, count: int) -> Sums:
    """Sum the colours of every label's runs.

    Parameters
    ----------
    planes
        Red, green and blue, ``(H, W)`` uint8 each.
    runs
        ``(n, 4)`` int32, see `components`.
    count
        Number of labels, background included.

    Returns
    -------
    numpy.ndarray
        ``(count, 7)`` int64: pixels, sums of R, G, B, and sums of their squares.
    """
    y, x, label = run_pixels(runs)
    return _sums(label, np.dstack(planes)[y, x], count)


def ring_sums(planes: Planes, runs: Runs, ring: Bits, count: int, width: int) -> Sums:
    """Sum the colours of every component's buffer ring (Eq. 10).

    Parameters
    ----------
    planes
        Red, green and blue, ``(H, W)`` uint8 each.
    runs
        ``(n, 4)`` int32, see `components`.
    ring
        ``(H, words)``: the pixels outside the shadow that some dilation reaches.
    count
        Number of labels, background included.
    width
        Number of 3x3 dilations: a ring pixel lies within this Chebyshev distance.

    Returns
    -------
    numpy.ndarray
        ``(count, 7)`` int64, as in `run_sums`. A pixel counts once in each component that
        reaches it.
    """
    height, columns = planes[0].shape
    y, x = np.nonzero(unpack(ring, columns))
    padded = np.pad(paint(runs, height, columns), width)
    window = np.lib.stride_tricks.sliding_window_view(padded, (2 * width + 1, 2 * width + 1))
    near = window[y, x].reshape(len(y), (2 * width + 1) ** 2)
    pixel = np.repeat(np.arange(len(y)), near.shape[1])
    pairs = np.unique(pixel * count + near.ravel())
    pairs = pairs[pairs % count > 0]
    return _sums(pairs % count, np.dstack(planes)[y, x][pairs // count], count)


def _sums(labels: npt.NDArray[np.integer], colours: npt.NDArray[np.uint8], count: int) -> Sums:
    values = colours.astype(np.float64)
    columns: list[npt.NDArray[np.float64]] = [np.bincount(labels, minlength=count).astype(float)]
    # Sums of 8-bit values and of their squares stay far below 2^53: float64 adds them exactly.
    columns += [np.bincount(labels, values[:, c], count).astype(float) for c in range(3)]
    columns += [np.bincount(labels, values[:, c] ** 2, count).astype(float) for c in range(3)]
    return np.stack(columns, axis=1).astype(np.int64)


def transfer(image: Image, runs: Runs, source: Matrix, target: Matrix, gain: Matrix) -> Image:
    """Map each component's colours to ``target + (I - source) * gain``, rounded and clipped.

    ``runs`` are ``(n, 4)``, see `components`; ``source``, ``target`` and ``gain`` ``(count, 3)``
    float64, by label and channel. Returns ``(H, W, 3)`` uint8, elsewhere as it was.
    """
    result = image.copy()
    y, x, k = run_pixels(runs)
    value = target[k] + (image[y, x] - source[k]) * gain[k]
    result[y, x] = np.clip(np.rint(value), 0, 255).astype(np.uint8)
    return result
