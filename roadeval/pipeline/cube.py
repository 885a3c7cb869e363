"""Sums over all 2^24 colours at once, each with a bound on how far it may be off.

A kernel machine whose features are a pixel's three colours alone is a function on the colour
cube, 256 levels a channel. Its value is a sum over support vectors of products (RBF) or of sums
(linear) of three factors, one a channel, so that all colours of one red level are a product of
matrices. Along a channel a factor changes slowly: polynomials through a few nodes give it at
every level, and since the factors themselves are few, the largest difference is looked up
rather than estimated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

LEVELS: Final = np.arange(256.0)
_NODES: Final = (16, 24, 32, 48, 64, 96, 128)
_ENOUGH: Final = 1e-6
"""Interpolation this close, weights included, leaves some twenty of all colours undecided."""
_EPS: Final = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, slots=True, eq=False)
class Slabs:
    """Values on the colour cube, a red level at a time.

    Parameters
    ----------
    of_red
        From a red level 0..255 to ``(256, 256)`` float64 values by green and blue level.
    error
        No value is further than this from the true one.
    """

    of_red: Callable[[int], Floats]
    error: float

    def __iter__(self) -> Iterator[Floats]:
        return (self.of_red(red) for red in range(256))


def sums_of_terms(terms: Floats, offset: float) -> Slabs:
    """Values ``terms[0, R] + terms[1, G] + terms[2, B] + offset`` for ``(3, 256)`` terms."""
    plane = terms[1][:, None] + terms[2][None, :] + offset
    largest = float(np.abs(terms).max(axis=1).sum()) + abs(offset)
    return Slabs(lambda red: plane + terms[0, red], 4 * _EPS * largest)


def sums_of_products(
    weights: Floats,
    factor: Callable[[int, Floats], Floats],
    offset: float,
    rounding: float,
) -> Slabs:
    """Values ``sum_i weights[i] f_i(0, R) f_i(1, G) f_i(2, B) + offset``.

    Parameters
    ----------
    weights
        ``(m,)``.
    factor
        ``factor(channel, levels)``: the ``(n, m)`` factors f_i of that channel, each in 0..1,
        at ``(n,)`` levels in 0..255, whole or not.
    offset
        Added to every sum.
    rounding
        How far a factor may be off as it is computed.
    """
    red = factor(0, LEVELS) * weights
    total = float(np.abs(weights).sum())
    exact = [factor(channel, LEVELS) for channel in (1, 2)]
    for count in (*_NODES, 256):
        nodes, matrix = _interpolation(count)
        green, blue = factor(1, nodes), factor(2, nodes)
        # Rows of the matrix sum to at most this: by so much it can swell an error.
        swell = float(np.abs(matrix).sum(axis=1).max())
        gaps = [
            float(np.abs(levels - matrix @ few).max()) + swell * (count * _EPS + 2 * rounding)
            for levels, few in zip(exact, (green, blue), strict=True)
        ]
        if total * sum(gaps) <= _ENOUGH:
            break
    # Errors of the factors; then of a product of matrices, at most its length in roundings.
    product = (1 + rounding) * (1 + gaps[0]) * (1 + gaps[1]) - 1
    products = swell**2 * (len(weights) + 2 * count + 4) * _EPS
    back = np.ascontiguousarray(matrix.T)

    def of_red(level: int) -> Floats:
        values: Floats = matrix @ ((green * red[level]) @ blue.T) @ back
        values += offset
        return values

    return Slabs(of_red, total * (product + products) + abs(offset) * _EPS)


def _interpolation(count: int) -> tuple[Floats, Floats]:
    """``(count,)`` Chebyshev nodes in 0..255, and the matrix from values there to all levels.

    With 256 nodes they are the levels, and nothing is interpolated.
    """
    if count == len(LEVELS):
        return LEVELS, np.eye(count)
    from numpy.polynomial.chebyshev import chebpts1, chebvander

    nodes = chebpts1(count)
    at_nodes, at_levels = (chebvander(x, count - 1) for x in (nodes, LEVELS / 127.5 - 1.0))
    return (nodes + 1.0) * 127.5, np.linalg.solve(at_nodes.T, at_levels.T).T
