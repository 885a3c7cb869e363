"""Compiled sum of rectified planes: the decision of `roadeval.pipeline.beyond.context`."""

from __future__ import annotations

import numpy as np

from roadeval.data.arrays import Values
from roadeval.kernels.compiler import compiled, part

_BLOCK = 512
"""Pixels at a time: with a dozen features each, they stay in the nearest cache."""


@compiled
def rectified_sum(
    features: tuple[Values, ...], planes: Values, bias: Values, weights: Values
) -> Values:
    """See `plain.rectified_sum`.

    The number of features is a part of a tuple's type. So the compiler knows it, unrolls the sum
    over them, and runs the loop over the pixels in vector instructions; for that, a pixel's
    features lie at fixed distances from each other in one array.
    """
    planes, bias, weights = _in_pairs(planes, bias, weights)
    pixels = len(features[0])
    result = np.empty(pixels, np.float32)
    block = np.zeros(len(features) * _BLOCK, np.float32)
    total = np.empty(_BLOCK, np.float32)
    for start in range(0, pixels, _BLOCK):
        size = min(_BLOCK, pixels - start)
        _take(features, start, size, block)
        # The last block may be short. What it has beyond the image is summed but not handed out.
        for pixel in range(_BLOCK):
            total[pixel] = 0
        # Two planes at a time: a feature that is read serves both.
        for plane in range(0, len(bias), 2):
            for pixel in range(_BLOCK):
                side, next_side = bias[plane], bias[plane + 1]
                for feature in range(len(features)):
                    value = block[feature * _BLOCK + pixel]
                    side += value * planes[plane, feature]
                    next_side += value * planes[plane + 1, feature]
                total[pixel] += max(side, np.float32(0)) * weights[plane]
                total[pixel] += max(next_side, np.float32(0)) * weights[plane + 1]
        for pixel in range(size):
            result[start + pixel] = total[pixel]
    return result


@part
def _in_pairs(planes: Values, bias: Values, weights: Values) -> tuple[Values, Values, Values]:
    """Return an even number of planes: what a plane of zeros adds to the sum is 0."""
    count, even = len(bias), len(bias) + len(bias) % 2
    all_planes = np.zeros((even, planes.shape[1]), np.float32)
    all_bias, all_weights = np.zeros(even, np.float32), np.zeros(even, np.float32)
    all_planes[:count], all_bias[:count], all_weights[:count] = planes, bias, weights
    return all_planes, all_bias, all_weights


@part
def _take(features: tuple[Values, ...], start: int, size: int, block: Values) -> None:
    """Lay the features of some pixels side by side."""
    for feature, values in enumerate(features):
        for pixel in range(size):
            block[feature * _BLOCK + pixel] = values[start + pixel]
