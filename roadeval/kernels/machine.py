"""The compiled loop of the machine on planes of features (`roadeval.pipeline.context`)."""

from __future__ import annotations

import numpy as np
from numba import njit

from roadeval.kernels.arrays import Values

_BLOCK = 512
"""Pixels at a time: with a dozen features each, they stay in the nearest cache."""


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def rectified_sum(
    features: tuple[Values, ...], planes: Values, bias: Values, weights: Values
) -> Values:
    """See `plain.rectified_sum`.

    How many features there are belongs to the type of a tuple. So the compiler knows it, writes the
    sum over them out, and runs the loop over the pixels in vector instructions; for that, a pixel's
    features lie at fixed distances from each other in one array.
    """
    pixels = len(features[0])
    result = np.empty(pixels, np.float32)
    block = np.zeros(len(features) * _BLOCK, np.float32)
    total = np.empty(_BLOCK, np.float32)
    for start in range(0, pixels, _BLOCK):
        size = min(_BLOCK, pixels - start)
        for feature, values in enumerate(features):
            for pixel in range(size):
                block[feature * _BLOCK + pixel] = values[start + pixel]
        # The last block may be short. What it has beyond the image is summed but not handed out.
        for pixel in range(_BLOCK):
            total[pixel] = 0
        for plane in range(len(bias)):
            for pixel in range(_BLOCK):
                side = bias[plane]
                for feature in range(len(features)):
                    side += block[feature * _BLOCK + pixel] * planes[plane, feature]
                total[pixel] += max(side, np.float32(0)) * weights[plane]
        for pixel in range(size):
            result[start + pixel] = total[pixel]
    return result
