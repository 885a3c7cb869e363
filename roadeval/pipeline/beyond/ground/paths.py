"""Geodesic distances: what must be crossed on the way from the reference patch to a pixel.

A kerb, a line of parked cars or a change of colour is crossed by every path from the ground in
front of the vehicle to what lies behind it, and the cheapest path goes around a mark, a shadow or
a drain. So the distance is small on the road wherever it leads, and grows by a step at its edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from roadeval.data import Mask
from roadeval.data.arrays import Values
from roadeval.kernels import KERNELS
from roadeval.pipeline.beyond.ground.group import Group
from roadeval.pipeline.beyond.ground.scene import Scene

ROUNDS: Final = 3
"""Sweeps up and down. More would shorten the path to about one pixel in a hundred by 1 %."""
SCALE: Final = 10_000
"""Of costs as whole numbers: the least has two digits."""
LENGTH: Final = 10 * SCALE
"""Of a straight step of cost 1, see `roadeval.kernels.plain.geodesics`."""
FLOOR: Final = 0.005
"""Cost of a step on the smoothest ground, so that a longer path costs more."""
GREATEST: Final = 6.5
"""Cost of a step over the hardest, which fits in 16 bit."""


def compute(scene: Scene) -> Sequence[Values]:
    """Return the distances over edges, over edges and hues, and over colours.

    With the gradient g of the log brightness a pixel, and the distances h of hues and d of colours
    to the patch in its deviations, the costs of a pixel are ``g``, ``g / 2 + min(h, 10) / 20`` and
    ``0.03 min(d, 15)``.
    """
    hue: Values = np.float32(1 / 20) * np.minimum(scene.hue, np.float32(10))
    colour: Values = np.float32(0.03) * np.minimum(scene.colour, np.float32(15))
    edge: Values = np.float32(1 / 2) * scene.edge
    costs = scene.edge, edge + hue, colour
    return [distance(cost, scene.patch) for cost in costs]


def distance(cost: Values, patch: Mask) -> Values:
    """Return the geodesic distance of each pixel from a patch, in pixels.

    It is ``min over paths of the integral of 0.005 + c`` (Toivanen 1996, see
    `roadeval.kernels.plain.geodesics`) for a cost c of each pixel, ``(h, w)`` float32, of which
    what is beyond `GREATEST` does not count.
    """
    whole = np.minimum(cost + np.float32(FLOOR), np.float32(GREATEST)) * np.float32(SCALE)
    found = KERNELS.geodesics(np.rint(whole).astype(np.uint16), patch, ROUNDS).astype(np.float32)
    lengths: Values = found / np.float32(LENGTH)
    return lengths


GROUP: Final = Group("paths", ("over_edges", "over_edges_and_hues", "over_colours"), compute)
