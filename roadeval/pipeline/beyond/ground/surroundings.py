"""What lies around a pixel: means of its tones, and how they change to the sides, up and down."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2

from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.ground.group import Group
from roadeval.pipeline.beyond.ground.scene import Scene, mean

WINDOWS: Final = (7, 19, 41)
"""Sides of the squares over which tones are averaged; the first is what is held against others."""
OFFSETS: Final = ((-14, 0), (14, 0), (28, 0), (-28, 0), (0, 20), (0, -20))
"""Columns and rows to those others. Beyond the border lies what lies there."""
_ACROSS, _DOWN = (max(abs(offset[way]) for offset in OFFSETS) for way in (0, 1))


def compute(scene: Scene) -> Sequence[Values]:
    """Return the means, and differences of means of light, blue-green and colour distance."""
    means = [mean(tone, side) for side in WINDOWS for tone in scene.tones]
    light, _, blue = means[:3]
    compared = light, blue, mean(scene.colour, WINDOWS[0])
    return [*means, *(change for plane in compared for change in _changes(plane))]


def _changes(plane: Values) -> list[Values]:
    """Return an ``(h, w)`` image less itself at each offset."""
    height, width = plane.shape
    border = _DOWN, _DOWN, _ACROSS, _ACROSS
    wide = cv2.copyMakeBorder(plane, *border, cv2.BORDER_REPLICATE)
    return [
        plane - wide[_DOWN + down :, _ACROSS + across :][:height, :width]
        for across, down in OFFSETS
    ]


GROUP: Final = Group(
    "surroundings",
    (
        *(f"{t}_{side}" for side in WINDOWS for t in ("light", "red_green", "blue_green")),
        *(
            f"{t}_to_{x}_{y}"
            for t in ("light", "blue_green", "colour_distance")
            for x, y in OFFSETS
        ),
    ),
    compute,
)
