"""The sum of rectified planes of a pixel's features."""

from __future__ import annotations

import numpy as np

from roadeval.data.arrays import Values


def rectified_sum(features: Values, planes: Values, bias: Values, weights: Values) -> Values:
    """Sum ``sum_k weights[k] max(planes[k] . x + bias[k], 0)`` of every pixel's features x.

    Parameters
    ----------
    features
        ``(F, n)`` float32: of each feature its value at every pixel.
    planes, bias, weights
        ``(K, F)``, ``(K,)`` and ``(K,)`` float32.

    Returns
    -------
    numpy.ndarray
        ``(n,)`` float32, added up in the order of the planes.
    """
    result: Values = np.zeros_like(features[0])
    for plane, start, weight in zip(planes, bias, weights, strict=True):
        side = np.full_like(result, start)
        for feature, slope in zip(features, plane, strict=True):
            side += feature * slope
        result += np.maximum(side, np.float32(0)) * weight
    return result
