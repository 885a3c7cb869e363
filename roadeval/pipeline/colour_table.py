"""A decision for every colour there is: 2^24 bits, in which a pixel's is looked up.

What depends on a pixel's three colours alone is a function on a cube of 256 levels a channel. Where
it is a sum of products of one factor a channel, as of an RBF kernel, all colours of one red level
are a product of matrices. Along a channel a factor changes slowly: polynomials through a few
Chebyshev nodes interpolate it at every level, and their error is measured.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt
from numpy.polynomial.chebyshev import chebpts1, chebvander

from roadeval.data import Mask, ones
from roadeval.data.arrays import Floats, Planes, Words
from roadeval.kernels import KERNELS

Colours = npt.NDArray[np.uint8]
Decide = Callable[[Colours], npt.NDArray[np.bool_]]
Margins = tuple[Callable[[int], Floats], float]
"""From a red level 0..255 to ``(256, 256)`` float64 margins by green and blue level; no margin is
further than the number from the true one."""

LEVELS: Final = np.arange(256.0)
EPS: Final = float(np.finfo(np.float64).eps)
ENOUGH: Final = 1e-6
"""Margins as near as this leave some twenty of all colours undecided."""
FEW: Final = 1 << 16
"""Undecided colours that are decided one by one, at most."""
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
    channel, each in 0..1, at ``(n,)`` levels in 0..255, whole or not. ``offset`` is added to every
    sum; ``rounding`` is how far a factor may be off as it is computed.
    """
    total = float(np.abs(weights).sum())
    exact = factor(1, LEVELS), factor(2, LEVELS)
    for count in _NODES:  # the fewest whose error, twice, is small enough
        nodes, matrix = _chebyshev(count) if count < 256 else (LEVELS, np.eye(256))
        green, blue = factor(1, nodes), factor(2, nodes)
        swell = float(np.abs(matrix).sum(axis=1).max())  # the most by which an error can grow
        seen = max(np.abs(exact[0] - matrix @ green).max(), np.abs(exact[1] - matrix @ blue).max())
        gap = float(seen) + swell * (count * EPS + 2 * rounding)
        if 2 * gap <= ENOUGH / total:
            break
    red = factor(0, LEVELS) * weights
    back = np.ascontiguousarray(matrix.T)

    def margins(level: int) -> Floats:
        values: Floats = matrix @ ((green * red[level]) @ blue.T) @ back
        values += offset
        return values

    # What the factors are off, and one rounding for each addition of the three matrix products.
    factors = (1 + rounding) * (1 + gap) ** 2 - 1
    additions = swell**2 * (len(weights) + 2 * count + 4) * EPS
    return margins, total * (factors + additions) + abs(offset) * EPS


def _chebyshev(count: int) -> tuple[Floats, Floats]:
    """Return ``(count,)`` Chebyshev nodes in 0..255; ``(256, count)`` from there to each level."""
    nodes = chebpts1(count)
    at_nodes, at_levels = (chebvander(x, count - 1) for x in (nodes, LEVELS / 127.5 - 1.0))
    matrix = np.linalg.solve(at_nodes.T, at_levels.T).T
    return (nodes + 1.0) * 127.5, matrix.astype(np.float64)


class ColourTable:
    """Which colours have a positive margin, each decided as exactly as by `decide`.

    ``margins`` is the margin of every colour: it decides where it is further from 0 than its error
    bound. ``decide`` is asked for the colours that are left, ``(n, 3)`` uint8 to ``(n,)`` bool:
    some twenty as a rule. Where more than `FEW` are left, as of a machine that has learnt nothing
    and whose margin is 0 everywhere, none of them has a positive one.
    """

    def __init__(self, margins: Margins, decide: Decide) -> None:
        self._road, left = _table(margins)
        if 0 < ones(left) <= FEW:
            places = np.flatnonzero(np.unpackbits(left.view(np.uint8), bitorder="little"))
            road = places[decide(_colours(places))]
            np.bitwise_or.at(self._road, road >> 6, np.uint64(1) << (road & 63).astype(np.uint64))

    def look_up(self, planes: Planes) -> Mask:
        """Return ``(H, W)`` uint8, 1 where a pixel's margin is positive; from any thread."""
        return KERNELS.look_up_colours(planes, self._road)


def _table(margins: Margins) -> tuple[Words, Words]:
    """Return the words of the colours that are road for certain, and of those undecided.

    A word holds a cube of 4x4x4 colours, so a block of four red levels fills 64 x 64 words::

        place of a colour    R7..R2 G7..G2 B7..B2 | R1 R0 G1 G0 B1 B0
                             word                 | bit

        a slab, one red level     (G, B) = (256, 256)
        reshaped                  (G7..G2, G1 G0, B7..B2, B1 B0) = (64, 4, 64, 4)
        transposed                (G7..G2, B7..B2, G1 G0, B1 B0) = (64, 64, 4, 4)
        four of them, the block   (G7..G2, B7..B2, R1 R0, G1 G0, B1 B0): word, then bit

    B1 B0 stay together, so that four colours are moved at once, as one number.
    """
    words = np.empty((2, 64, 64 * 64), np.uint64)
    block = np.empty((2, 64, 64, 4, 4), np.uint32)
    road, left = block
    of_red, error = margins
    for red in range(256):
        margin = of_red(red)
        above = margin > error
        for kind, slab in ((road, above), (left, above ^ (margin >= -error))):
            kind[:, :, red & 3] = slab.view(np.uint32).reshape(64, 4, 64).transpose(0, 2, 1)
        if red & 3 == 3:
            colours = block.view(np.bool_).reshape(2, -1)
            bits = np.packbits(colours, axis=1, bitorder="little")
            words[:, red >> 2] = bits.view(np.uint64)
    return words[0].reshape(-1), words[1].reshape(-1)


def _colours(places: npt.NDArray[np.int64]) -> Colours:
    """Return the ``(n, 3)`` colours of ``(n,)`` places: the word times 64, and the bit in it."""
    coarse = places >> 18, places >> 12 & 63, places >> 6 & 63
    fine = places >> 4 & 3, places >> 2 & 3, places & 3
    channels = [c << 2 | f for c, f in zip(coarse, fine, strict=True)]
    return np.stack(channels, axis=1).astype(np.uint8)
