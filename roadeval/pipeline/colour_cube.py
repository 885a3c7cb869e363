"""Sums over all 2^24 colours at once, each with a bound on how far it may be off.

A kernel machine whose features are a pixel's three colours alone is a function on the colour
cube, 256 levels a channel. Its value is a sum over support vectors of products (RBF) or of sums
(linear) of three factors, one a channel, so that all colours of one red level are a product of
matrices. Along a channel a factor changes slowly: polynomials through a few nodes interpolate it at
every level, and since there are few factors, their error is measured, not estimated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.polynomial.chebyshev import chebpts1, chebvander

from roadeval.data.arrays import Floats

Factor = Callable[[int, Floats], Floats]

LEVELS: Final = np.arange(256.0)
EPS: Final = float(np.finfo(np.float64).eps)
_NODES: Final = (16, 24, 32, 48, 64, 96, 128, 256)
_ENOUGH: Final = 1e-6
"""Values interpolated this well leave some twenty of all colours undecided."""


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
    """Return values ``terms[0, R] + terms[1, G] + terms[2, B] + offset`` for ``(3, 256)`` terms."""
    plane = terms[1][:, None] + terms[2][None, :] + offset
    largest = float(np.abs(terms).max(axis=1).sum()) + abs(offset)
    return Slabs(lambda red: plane + terms[0, red], 4 * EPS * largest)


def sums_of_products(weights: Floats, factor: Factor, offset: float, *, rounding: float) -> Slabs:
    """Return the values ``sum_i weights[i] f_i(0, R) f_i(1, G) f_i(2, B) + offset``.

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
    total = float(np.abs(weights).sum())
    near = _interpolation(factor, _ENOUGH / total, rounding)
    red = factor(0, LEVELS) * weights
    back = np.ascontiguousarray(near.matrix.T)

    def of_red(level: int) -> Floats:
        values: Floats = near.matrix @ ((near.green * red[level]) @ near.blue.T) @ back
        values += offset
        return values

    # What the factors are off, and one rounding for each addition of the three matrix products.
    factors = (1 + rounding) * (1 + near.gap) ** 2 - 1
    additions = near.swell**2 * (len(weights) + 2 * len(near.green) + 4) * EPS
    return Slabs(of_red, total * (factors + additions) + abs(offset) * EPS)


@dataclass(frozen=True, slots=True, eq=False)
class _Interpolation:
    """Factors of green and blue at k nodes, and how to get from there to all levels.

    ``green`` and ``blue`` are ``(k, m)``, ``matrix`` is ``(256, k)``; no row of it sums to more
    than ``swell`` in absolute value, so that much it can enlarge an error. An interpolated
    factor is within ``gap`` of the true one.
    """

    green: Floats
    blue: Floats
    matrix: Floats
    swell: float
    gap: float


def _interpolation(factor: Factor, tolerance: float, rounding: float) -> _Interpolation:
    """Take the fewest Chebyshev nodes that keep the gap, twice, within the tolerance.

    With 256 nodes, the levels themselves, nothing is interpolated.
    """
    exact = factor(1, LEVELS), factor(2, LEVELS)
    for count in _NODES:
        nodes, matrix = _chebyshev(count) if count < 256 else (LEVELS, np.eye(256))
        green, blue = factor(1, nodes), factor(2, nodes)
        swell = float(np.abs(matrix).sum(axis=1).max())
        seen = max(np.abs(exact[0] - matrix @ green).max(), np.abs(exact[1] - matrix @ blue).max())
        gap = float(seen) + swell * (count * EPS + 2 * rounding)
        if 2 * gap <= tolerance:
            break
    return _Interpolation(green, blue, matrix, swell, gap)


def _chebyshev(count: int) -> tuple[Floats, Floats]:
    """Return ``(count,)`` Chebyshev nodes in 0..255; ``(256, count)`` from there to each level."""
    nodes = chebpts1(count)
    at_nodes, at_levels = (chebvander(x, count - 1) for x in (nodes, LEVELS / 127.5 - 1.0))
    matrix = np.linalg.solve(at_nodes.T, at_levels.T).T
    return (nodes + 1.0) * 127.5, matrix.astype(np.float64)
