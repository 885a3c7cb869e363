"""Cheapest paths from some pixels to all others."""

from __future__ import annotations

from typing import Final

import numpy as np

from roadeval.data.arrays import Costs, Distances, Plane, Sums

FAR: Final = 1 << 30
"""Distance of what no path reaches; no distance is greater."""
STRAIGHT: Final = 5
ASLANT: Final = 7
"""Length of a step to a neighbour by a side and by a corner: 7/5 is the root of 2, less 1 %."""


def geodesics(cost: Costs, seeds: Plane, rounds: int) -> Distances:
    """Compute the length of the cheapest path from the seeds to each pixel.

    A path goes from neighbour to neighbour, by sides and corners. A step costs the sum of its two
    pixels' costs times `STRAIGHT` or `ASLANT`: ten times the integral of the cost along it [1]_.
    Rows are swept up and down by turns, paths within a row included, as raster scans do [2]_:
    a path that turns back up or down more often than there are ``rounds`` may be missed for a
    dearer one. Whole numbers make the order of sums irrelevant.

    Parameters
    ----------
    cost
        ``(H, W)`` uint16: of a step of length 1.
    seeds
        ``(H, W)`` uint8, nonzero where paths begin.
    rounds
        Of a sweep up and one down.

    Returns
    -------
    numpy.ndarray
        ``(H, W)`` int32, at most `FAR`.

    References
    ----------
    .. [1] P. J. Toivanen, New geodesic distance transforms for gray-scale images, Pattern
       Recognition Letters 17 (1996).
    .. [2] G. Borgefors, Distance transformations in digital images, CVGIP 34 (1986).
    """
    costs = cost.astype(np.int64)
    distance = np.where(seeds > 0, 0, FAR)
    for _ in range(rounds):
        _sweep(costs[::-1], distance[::-1])
        _sweep(costs, distance)
    return distance.astype(np.int32)


def _sweep(cost: Sums, distance: Sums) -> None:
    """Shorten paths, in place, by the steps from each row to the next and within it."""
    for y in range(len(cost)):
        if y > 0:
            _step(distance[y], cost[y], distance[y - 1], cost[y - 1], STRAIGHT)
            _step(distance[y, 1:], cost[y, 1:], distance[y - 1, :-1], cost[y - 1, :-1], ASLANT)
            _step(distance[y, :-1], cost[y, :-1], distance[y - 1, 1:], cost[y - 1, 1:], ASLANT)
        for way in (slice(None), slice(None, None, -1)):
            row, price = distance[y, way], cost[y, way]
            sums = np.concatenate([[0], np.cumsum(STRAIGHT * (price[1:] + price[:-1]))])
            row[:] = np.minimum.accumulate(row - sums) + sums


def _step(to: Sums, cost: Sums, start: Sums, other: Sums, length: int) -> None:
    np.minimum(to, start + length * (cost + other), out=to)
