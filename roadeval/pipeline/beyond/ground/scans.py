"""What lies between a pixel and the image's lower edge, its upper edge, and its middle column.

Whoever drives up the column to the pixel meets no kerb and no shadow under a car as long as there
is road.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np

from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.ground.group import Group
from roadeval.pipeline.beyond.ground.scene import Scene, mean


def compute(scene: Scene) -> Sequence[Values]:
    """Return what `_column` finds below and above, and what is met from the middle outwards.

    In a row these are the root of the steepest slope across, and the furthest hue.
    """
    steep, far = _strips(np.abs(scene.slopes[0]), (3, 5)), mean(scene.hue, 3)
    columns = [plane for upwards in (True, False) for plane in _column(scene, upwards)]
    return [*columns, outwards(np.sqrt(steep)), outwards(far)]


def _column(scene: Scene, upwards: bool) -> list[Values]:
    """Return what is met along each column until a pixel is reached, from below or from above.

    The root of the steepest slope down, the least and the greatest log brightness, the mean
    distance of colours to the patch, the greatest of hues, and the sum of edges.
    """
    step = -1 if upwards else 1
    light, colour = mean(scene.tones[0], 5)[::step], mean(scene.colour, 3)[::step]
    steep = np.sqrt(_strips(np.abs(scene.slopes[1]), (5, 3)))[::step]
    count = np.arange(1, len(light) + 1, dtype=np.float32)[:, None]
    met = [
        np.maximum.accumulate(steep),
        np.minimum.accumulate(light),
        np.maximum.accumulate(light),
        np.add.accumulate(colour) / count,
        np.maximum.accumulate(mean(scene.hue, 3)[::step]),
        np.add.accumulate(_strips(scene.edge, (5, 3))[::step]),
    ]
    return [plane[::step] for plane in met]


def outwards(plane: Values) -> Values:
    """Return the greatest value met along a row from the image's middle to each pixel."""
    half = plane.shape[1] // 2
    found = np.empty_like(plane)
    np.maximum.accumulate(plane[:, half:], axis=1, out=found[:, half:])
    left = np.s_[:, half - 1 :: -1] if half else np.s_[:, :0]
    found[left] = np.maximum.accumulate(plane[left], axis=1)
    return found


def _strips(plane: Values, size: tuple[int, int]) -> Values:
    averaged: Values = cv2.blur(plane, size)
    return averaged


_MET: Final = ("edge", "darkest", "brightest", "mean_colour", "furthest_hue", "sum_of_edges")

GROUP: Final = Group(
    "scans",
    (*(f"{met}_{way}" for way in ("below", "above") for met in _MET), "edge_inside", "hue_inside"),
    compute,
)
