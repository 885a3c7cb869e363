"""The NumPy twins of the compiled kernels: the definitions, and the way out where none compile."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Codes = npt.NDArray[np.uint8]
Labels = npt.NDArray[np.int32]
Sums = npt.NDArray[np.int64]


def look_up_sum_min(
    image: npt.NDArray[np.uint8], table: Codes
) -> tuple[Codes, npt.NDArray[np.int64]]:
    """Look every pixel up by the sum and the minimum of its channels.

    Parameters
    ----------
    image
        ``(H, W, 3)`` uint8.
    table
        ``(766, 256)`` uint8, indexed by ``R + G + B`` and ``min(R, G, B)``.

    Returns
    -------
    codes, histogram
        ``(H, W)`` uint8, and ``(256,)`` int64: how often each code occurs.
    """
    codes = table[image.sum(axis=2, dtype=np.int64), image.min(axis=2)]
    return codes, np.bincount(codes.ravel(), minlength=256)


def region_sums(
    image: npt.NDArray[np.uint8], labels: Labels, ring: Codes, count: int, width: int
) -> tuple[Sums, Sums]:
    """Sum the colours inside every component and inside its buffer ring (Eq. 10).

    Parameters
    ----------
    image
        ``(H, W, 3)`` uint8.
    labels
        ``(H, W)`` int32: 0 outside the shadow, else the component.
    ring
        ``(H, W)`` uint8: nonzero on pixels outside the shadow that some dilation reaches.
    count
        Number of labels, background included.
    width
        Number of 3x3 dilations: a ring pixel lies within this Chebyshev distance.

    Returns
    -------
    inside, outside
        ``(count, 7)`` int64 each: pixels, sums of R, G, B, and sums of their squares. A ring
        pixel counts once in each component that reaches it.
    """
    shadow = labels > 0
    inside = _sums(labels[shadow], image[shadow], count)
    y, x = np.nonzero(ring)
    padded = np.pad(labels, width)
    window = np.lib.stride_tricks.sliding_window_view(padded, (2 * width + 1, 2 * width + 1))
    near = window[y, x].reshape(len(y), (2 * width + 1) ** 2)
    pixel = np.repeat(np.arange(len(y)), near.shape[1])
    pairs = np.unique(pixel * count + near.ravel())
    pairs = pairs[pairs % count > 0]
    return inside, _sums(pairs % count, image[y, x][pairs // count], count)


def _sums(labels: npt.NDArray[np.integer], colours: npt.NDArray[np.uint8], count: int) -> Sums:
    values = colours.astype(np.float64)
    columns: list[npt.NDArray[np.float64]] = [np.bincount(labels, minlength=count).astype(float)]
    # Sums of 8-bit values and of their squares stay far below 2^53: float64 adds them exactly.
    columns += [np.bincount(labels, values[:, c], count).astype(float) for c in range(3)]
    columns += [np.bincount(labels, values[:, c] ** 2, count).astype(float) for c in range(3)]
    return np.stack(columns, axis=1).astype(np.int64)


def transfer(
    image: npt.NDArray[np.uint8],
    labels: Labels,
    source: npt.NDArray[np.float64],
    target: npt.NDArray[np.float64],
    gain: npt.NDArray[np.float64],
) -> npt.NDArray[np.uint8]:
    """Map each component's colours to ``target + (I - source) * gain``, rounded and clipped.

    ``source``, ``target`` and ``gain`` are ``(count, 3)`` float64 by label and channel; label 0
    is left as it is. Returns ``(H, W, 3)`` uint8.
    """
    result = image.copy()
    shadow = labels > 0
    k = labels[shadow]
    value = target[k] + (image[shadow] - source[k]) * gain[k]
    result[shadow] = np.clip(np.rint(value), 0, 255).astype(np.uint8)
    return result


def mahalanobis(
    image: npt.NDArray[np.uint8],
    mean: npt.NDArray[np.float64],
    precision: npt.NDArray[np.float64],
    greatest: float,
) -> tuple[npt.NDArray[np.float32], Codes]:
    """Distance of Eq. 2, the root of ``(x - m)^T P (x - m)``, of every pixel.

    Parameters
    ----------
    image
        ``(H, W, 3)`` uint8.
    mean, precision
        m, ``(3,)``, and the symmetric inverse covariance P, ``(3, 3)``.
    greatest
        Of the square, up to which a pixel is near.

    Returns
    -------
    distance, near
        ``(H, W)`` float32, and ``(H, W)`` uint8, decided in float64: 1 near, 0 far.
    """
    r, g, b = (image[..., c] - mean[c] for c in range(3))
    squared: npt.NDArray[np.float64] = (
        precision[0, 0] * (r * r)
        + precision[1, 1] * (g * g)
        + precision[2, 2] * (b * b)
        + 2.0 * precision[0, 1] * (r * g)
        + 2.0 * precision[0, 2] * (r * b)
        + 2.0 * precision[1, 2] * (g * b)
    )
    return np.sqrt(squared.astype(np.float32)), (squared <= greatest).astype(np.uint8)


def areas(labels: Labels, count: int) -> npt.NDArray[np.int64]:
    """Count the pixels of each of ``count`` labels of an ``(H, W)`` image: ``(count,)`` int64."""
    return np.bincount(labels.ravel(), minlength=count)


def look_up_colours(image: npt.NDArray[np.uint8], table: Codes) -> Codes:
    """Look every pixel up in a table over all 2^24 colours, index ``R << 16 | G << 8 | B``."""
    wide = image.astype(np.int32)
    found: Codes = table[(wide[..., 0] << 16) | (wide[..., 1] << 8) | wide[..., 2]]
    return found


def rectified_sum(
    features: npt.NDArray[np.float32],
    planes: npt.NDArray[np.float32],
    bias: npt.NDArray[np.float32],
    weights: npt.NDArray[np.float32],
) -> npt.NDArray[np.float32]:
    """Sum ``sum_k weights[k] max(planes[k] . x + bias[k], 0)`` of every pixel's features x.

    Parameters
    ----------
    features
        ``(F, n)`` float32: a row a feature, a column a pixel.
    planes, bias, weights
        ``(K, F)``, ``(K,)`` and ``(K,)`` float32.

    Returns
    -------
    numpy.ndarray
        ``(n,)`` float32, added up in the order of the planes.
    """
    result = np.zeros(features.shape[1], np.float32)
    for plane, start, weight in zip(planes, bias, weights, strict=True):
        side = np.full_like(result, start)
        for feature, slope in zip(features, plane, strict=True):
            side += feature * slope
        result += np.maximum(side, np.float32(0)) * weight
    return result
