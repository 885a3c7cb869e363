"""A pixel's colour, apart from the light that falls on it, and how far it is from the patch's.

A projection of the log-chromaticities on one direction keeps what a change between sunlight and
skylight leaves alone; which direction that is depends on the camera [1]_, so there are three.

References
----------
.. [1] J. M. Alvarez, A. M. Lopez, Road Detection Based on Illuminant Invariance, IEEE Transactions
   on Intelligent Transportation Systems 12 (2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.ground.group import Group
from roadeval.pipeline.beyond.ground.scene import Scene, mean

ANGLES: Final = (30, 45, 60)
"""Of the projections, in degrees from ``ln R - ln G`` towards ``ln B - ln G``."""
SMOOTH: Final = 7
"""Side of the square over which the distance to the patch is averaged."""


def compute(scene: Scene) -> Sequence[Values]:
    """Return red, green, blue, the tones, their projections, and the distances to the patch."""
    _, red, blue = scene.tones
    _, own_red, own_blue = scene.middle
    projected = [
        (red - own_red) * np.float32(np.cos(angle)) + (blue - own_blue) * np.float32(np.sin(angle))
        for angle in np.radians(ANGLES)
    ]
    channels = list(np.moveaxis(scene.image, 2, 0))
    distances = scene.colour, scene.hue, mean(scene.colour, SMOOTH)
    return [*channels, *scene.tones, *projected, *distances]


GROUP: Final = Group(
    "colour",
    (
        *("red", "green", "blue", "light", "red_green", "blue_green"),
        *(f"projection_{angle}" for angle in ANGLES),
        *("colour_distance", "hue_distance", "colour_distance_around"),
    ),
    compute,
)
