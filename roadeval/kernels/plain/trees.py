"""The sum of decision trees."""

from __future__ import annotations

from typing import Final

import numpy as np

from roadeval.data.arrays import Indices, Masks, Values

LEAVES: Final = 32
"""Of a tree, at most."""


def tree_sum(
    features: Values, feature: Indices, threshold: Values, kept: Masks, values: Values
) -> Values:
    """Compute the sum of what decision trees give for each pixel.

    A tree's leaves are numbered from the left. Each of its nodes whose feature is above the
    threshold rules out the leaves on its left; the first that no node has ruled out is the
    pixel's [1]_.

    Parameters
    ----------
    features
        ``(F, n)`` float32: of n pixels.
    feature, threshold, kept
        ``(T, N)`` each, int32, float32 and uint32, of N nodes of T trees: a feature's place, what
        it is compared with, and a bit for each leaf that is left where it is above that. The
        highest bit is always set.
    values
        ``(T, LEAVES)`` float32: what each leaf adds.

    Returns
    -------
    numpy.ndarray
        ``(n,)`` float32, summed in the trees' order.

    References
    ----------
    .. [1] C. Lucchese et al., QuickScorer: A Fast Algorithm to Rank Documents with Additive
       Ensembles of Regression Trees, SIGIR 2015.
    """
    total: Values = np.zeros(features.shape[1], np.float32)
    for which, least, left, given in zip(feature, threshold, kept, values, strict=True):
        above = features[which] > least[:, None]
        leaves = np.bitwise_and.reduce(np.where(above, left[:, None], ~np.uint32(0)), axis=0)
        first = np.bitwise_count((leaves & -leaves) - np.uint32(1))
        total += given[first]
    return total
