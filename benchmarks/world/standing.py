"""Things that stand on one foot beside the road: seen as one panel, in the sun's way as it is.

Trees and posts alike: leaves and rods block the sun, a picture shows them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.world.panel import Panel, Picture
from benchmarks.world.shadows import Silhouettes
from roadeval.data.arrays import Floats

NO_LEAVES: Final = np.empty((0, 3))


@dataclass(frozen=True, slots=True)
class Rod:
    """A straight piece of wood or metal between two ``(3,)`` points, metres."""

    foot: Floats
    tip: Floats
    radius: float


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """A thing with its foot at the origin, painted as seen along +Z.

    ``leaves`` are ``(n, 3)`` metres; the picture spans ``-half_width..half_width`` in X and
    ``0..height`` in Y.
    """

    picture: Picture
    half_width: float
    height: float
    leaves: Floats
    rods: tuple[Rod, ...]

    def panel(self, foot: Floats, scale: float) -> Panel:
        """Return its panel with the foot at ``(3,)``, ``scale`` times as large."""
        corner = foot + scale * np.array([-self.half_width, self.height, 0.0])
        right = scale * np.array([2 * self.half_width, 0.0, 0.0])
        return Panel(self.picture, corner, right, scale * np.array([0.0, -self.height, 0.0]))

    def occlude(self, silhouettes: Silhouettes, foot: Floats, scale: float) -> None:
        """Stand in the sun's way."""
        silhouettes.add_leaves(foot + scale * self.leaves)
        if self.rods:
            feet = foot + scale * np.stack([rod.foot for rod in self.rods])
            tips = foot + scale * np.stack([rod.tip for rod in self.rods])
            silhouettes.add_rods(feet, tips, scale * np.array([rod.radius for rod in self.rods]))
