"""Thin things that bound a road, found at twice the size: kerbs, seams, yellow and dark lines.

The greatest of each four pixels is kept, so that a line of one pixel is not averaged away.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.ground.group import Group
from roadeval.pipeline.beyond.ground.paths import distance
from roadeval.pipeline.beyond.ground.scans import outwards
from roadeval.pipeline.beyond.ground.scene import Scene, mean, slopes_of, steepness, tones_of

THIN, WIDE = 3, 15
"""Sides of the squares whose means differ where there is a thin line."""
SURROUNDINGS: Final = 31
"""Side of the square that an edge is held against: on a smooth pavement a low kerb is steep."""
FAINT: Final = 0.02
"""Added to that square's mean edge: noise is no edge."""
WEIGHTS: Final = {"edge": 1.0, "relative_edge": 0.05, "hue_edge": 1.0, "yellow": 1.0, "dark": 1.0}
"""What each adds to the cost of a path."""
SQUARED: Final = {"edge": 20.0, "relative_edge": 0.05}
"""Weights of squared barriers in the costs of further paths. These go a long way through what is
faint before they cross anything steep: around the end of a kerb, not over it."""


def compute(scene: Scene) -> Sequence[Values]:
    """Return each barrier at a pixel, on its path from the patch, and from the middle outwards.

    The distances over the squares of `SQUARED` come last. Each is ``(h, w)`` float32; distances
    are those of `distance`, in pixels.
    """
    found = [greatest_of_four(plane) for plane in barriers(tones_of(scene.fine))]
    named = dict(zip(WEIGHTS, found, strict=True))
    costs = [
        *(named[name] * np.float32(weight) for name, weight in WEIGHTS.items()),
        *(np.square(named[name]) * np.float32(weight) for name, weight in SQUARED.items()),
    ]
    paths = [distance(cost, scene.patch) for cost in costs]
    direct, around = paths[: len(found)], paths[len(found) :]
    return [*found, *direct, *(outwards(plane) for plane in found), *around]


def barriers(tones: tuple[Values, Values, Values]) -> list[Values]:
    """Return the barriers of tones at twice the size, in the order of `WEIGHTS`.

    The gradient of the log brightness; the same held against its surroundings; the sum of the
    chromaticities' gradients; and how much a thin line is yellower, ``(ln R + ln G) / 2 - ln B``,
    or darker than what surrounds it.
    """
    light, red, blue = tones
    edge = steepness(slopes_of(light))
    hues: Values = steepness(slopes_of(red)) + steepness(slopes_of(blue))
    yellow: Values = np.float32(1 / 2) * red - blue
    return [
        edge,
        edge / (mean(edge, SURROUNDINGS) + np.float32(FAINT)),
        hues,
        np.maximum(mean(yellow, THIN) - mean(yellow, WIDE), 0),
        np.maximum(mean(light, WIDE) - mean(light, THIN), 0),
    ]


def greatest_of_four(plane: Values) -> Values:
    """Return the greatest of each four pixels of a ``(2 h, 2 w)`` image, ``(h, w)``."""
    rows = np.maximum(plane[::2], plane[1::2])
    return np.maximum(rows[:, ::2], rows[:, 1::2])


GROUP: Final = Group(
    "barriers",
    (
        *WEIGHTS,
        *(f"over_{name}" for name in WEIGHTS),
        *(f"{name}_inside" for name in WEIGHTS),
        *(f"around_{name}" for name in SQUARED),
    ),
    compute,
)
