"""A decision for every possible colour: a table of 2^24 bits, in which pixels are looked up.

A decision that depends on a pixel's colour alone is a function on a cube of 256 levels per channel.
If it is a sum of products of one factor per channel, as for an RBF kernel, all colours of one red
level are a product of matrices. Along a channel a factor changes slowly: polynomials through a few
Chebyshev nodes interpolate it at every level, and their error is measured.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.polynomial.chebyshev import chebpts1, chebvander

from roadeval.data import ones
from roadeval.data.arrays import Flags, Floats, Plane, Words

Decide = Callable[[Plane], Flags]
Margins = tuple[Callable[[int], Floats], float]
"""A function from a red level 0..255 to ``(256, 256)`` float64 margins by green and blue level; and
the greatest distance of a margin from the true one."""

LEVELS: Final = np.arange(256.0)
EPS: Final = float(np.finfo(np.float64).eps)
ENOUGH: Final = 1e-6
"""An error of margins that leaves some twenty of all colours undecided."""
FEW: Final = 1 << 16
"""Greatest number of undecided colours that are decided one by one."""
_NODES: Final = (16, 24, 32, 48, 64, 96, 128, 256)


def sums_of_terms(terms: Floats, offset: float) -> Margins:
    """Return margins ``terms[0, R] + terms[1, G] + terms[2, B] + offset``, terms ``(3, 256)``."""
    plane = terms[1][:, None] + terms[2][None, :] + offset
    largest = float(np.abs(terms).max(axis=1).sum()) + abs(offset)
    return lambda red: plane + terms[0, red], 4 * EPS * largest


def sums_of_products(
    weights: Floats, factor: Callable[[int, Floats], Floats], offset: float, *, rounding: float
) -> Margins:
    """Return the margins ``sum_i weights[i] f_i(0, R) f_i(1, G) f_i(2, B) + offset``.

    ``weights`` are ``(m,)``; ``factor(channel, levels)`` returns the ``(n, m)`` factors f_i of that
    channel, each in 0..1, at ``(n,)`` levels in 0..255, which need not be integers. ``offset`` is
    added to every sum; ``rounding`` bounds the rounding error of a factor.
    """
    total = float(np.abs(weights).sum())
    exact = factor(1, LEVELS), factor(2, LEVELS)
    for count in _NODES:  # the fewest nodes with a small enough error
        nodes, matrix = interpolation(count) if count < 256 else (LEVELS, np.eye(256))
        green, blue = factor(1, nodes), factor(2, nodes)
        swell = float(np.abs(matrix).sum(axis=1).max())  # the greatest growth of an error
        seen = max(np.abs(exact[0] - matrix @ green).max(), np.abs(exact[1] - matrix @ blue).max())
        gap = float(seen) + swell * (count * EPS + 2 * rounding)
        if 2 * gap <= ENOUGH / total:
            break
    red = factor(0, LEVELS) * weights
    back = np.ascontiguousarray(matrix.T)

    def margins(level: int) -> Floats:
        values = matrix @ ((green * red[level]) @ blue.T) @ back
        values += offset
        return values

    # The error of the factors, and one rounding for each addition of the three matrix products.
    factors = (1 + rounding) * (1 + gap) ** 2 - 1
    additions = swell**2 * (len(weights) + 2 * count + 4) * EPS
    return margins, total * (factors + additions) + abs(offset) * EPS


def interpolation(count: int) -> tuple[Floats, Floats]:
    """Return ``(count,)`` Chebyshev nodes in 0..255; ``(256, count)`` weights for each level."""
    nodes = chebpts1(count)
    at_nodes, at_levels = (chebvander(x, count - 1) for x in (nodes, LEVELS / 127.5 - 1.0))
    matrix = np.linalg.solve(at_nodes.T, at_levels.T).T
    return (nodes + 1.0) * 127.5, matrix.astype(np.float64)


def table_of(margins: Margins, decide: Decide) -> Words:
    """Return which colours have a positive margin, for `roadeval.kernels.plain.look_up_colours`.

    Each decision is exactly that of ``decide``, which takes colours, ``(n, 3)`` uint8, and returns
    ``(n,)`` bool: a margin decides if it is further from 0 than its error bound, else ``decide``
    does, usually for some twenty colours. If there are more than `FEW` of these, as with a margin
    of 0 everywhere if nothing was learnt, none of them counts as positive.

    A word holds a cube of 4x4x4 colours, so a block of four red levels fills 64 x 64 words::

        place of a colour    R7..R2 G7..G2 B7..B2 | R1 R0 G1 G0 B1 B0
                             word                 | bit

        a slab, one red level     (G, B) = (256, 256)
        reshaped                  (G7..G2, G1 G0, B7..B2, B1 B0) = (64, 4, 64, 4)
        transposed                (G7..G2, B7..B2, G1 G0, B1 B0) = (64, 64, 4, 4)
        four of them, the block   (G7..G2, B7..B2, R1 R0, G1 G0, B1 B0): word, then bit

    B1 B0 stay together, so that four colours move at once, as one number.
    """
    words = np.empty((2, 64, 64 * 64), np.uint64)
    block = np.empty((2, 64, 64, 4, 4), np.uint32)
    of_red, error = margins
    for red in range(256):
        margin = of_red(red)
        above = margin > error
        for kind, slab in zip(block, (above, above ^ (margin >= -error)), strict=True):
            kind[:, :, red & 3] = slab.view(np.uint32).reshape(64, 4, 64).transpose(0, 2, 1)
        if red & 3 == 3:
            colours = block.view(np.bool_).reshape(2, -1)
            words[:, red >> 2] = np.packbits(colours, axis=1, bitorder="little").view(np.uint64)
    road, left = words.reshape(2, -1)
    if 0 < ones(left) <= FEW:
        places = np.flatnonzero(np.unpackbits(left.view(np.uint8), bitorder="little"))
        cubes = np.array(np.unravel_index(places, (64, 64, 64, 4, 4, 4)))
        positive = places[decide((cubes[:3] << 2 | cubes[3:]).T.astype(np.uint8))]
        np.bitwise_or.at(road, positive >> 6, np.uint64(1) << (positive & 63).astype(np.uint64))
    return road
