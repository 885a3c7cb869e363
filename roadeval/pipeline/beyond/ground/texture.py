"""Texture: the root of the mean absolute slope of the log brightness, across and down.

Kerbs, wheels and house fronts have edges of one direction, leaves of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.ground.group import Group
from roadeval.pipeline.beyond.ground.scene import Scene, mean

WINDOWS: Final = (3, 9, 21)
"""Sides of the squares over which slopes are averaged."""
DEVIATION: Final = 9
"""Side of the square in which the log brightness deviates."""


def compute(scene: Scene) -> Sequence[Values]:
    """Return both textures in each window, and the deviation of the log brightness."""
    slopes = [np.abs(slope) for slope in scene.slopes]
    textures = [np.sqrt(mean(slope, side)) for side in WINDOWS for slope in slopes]
    light = scene.tones[0]
    variance = mean(light * light, DEVIATION) - np.square(mean(light, DEVIATION))
    return [*textures, np.sqrt(np.maximum(variance, 0))]


GROUP: Final = Group(
    "texture",
    (*(f"{way}_{side}" for side in WINDOWS for way in ("across", "down")), "deviation"),
    compute,
)
