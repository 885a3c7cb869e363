"""A training truth for logs that have none: what the ground in front of the vehicle leads to.

The ground right in front of a vehicle is road, and so is what can be reached from there without
crossing an edge: a kerb, a verge or another vehicle.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from roadeval.data import NON_ROAD, ROAD, Rgb, Truth
from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.ground.barriers import SQUARED, greatest_of_four
from roadeval.pipeline.beyond.ground.paths import distance
from roadeval.pipeline.beyond.ground.scene import Scene, scene_of, slopes_of, steepness, tones_of
from roadeval.pipeline.beyond.working_image import stretched
from roadeval.pipeline.reference_patch import patch_mask
from roadeval.training.settings import TrainingSettings

WIDTH: Final = 160
"""Columns of the working image on which paths are sought."""
OVER, AROUND = 1.2, 2.0
"""Geodesic distances over edges and over squared ones at which roads end: these thresholds are the
best, or next to it, on the train part of IDD Lite, on two of CamVid's drives and on rendered ones.
"""


def patch_truth(image: Rgb, settings: TrainingSettings) -> Truth:
    """Guess the truth of an ``(H, W, 3)`` uint8 RGB image from its reference patch.

    Road (1) is the patch, and what lies below the horizon row and within ``settings.reach`` of it,
    see `reach`; all else is not (0). Returns ``(H, W)`` uint8.
    """
    height, width = image.shape[:2]
    near = stretched(reach(scene_of(image, WIDTH, settings.patch)), image.shape) < settings.reach
    near[: round(settings.horizon * height)] = False
    near |= patch_mask(height, width, settings.patch) > 0
    return np.where(near, ROAD, NON_ROAD).astype(np.uint8)


def reach(scene: Scene) -> Values:
    """Return how far each pixel lies from the patch, ``(h, w)`` float32; roads end at about 1.

    It is the mean of two geodesic distances, each over its threshold: over the edges of the working
    image, which grows with all that is crossed, and over the squared ones of the image at twice its
    size, which grows where something steep is and sees thin kerbs.
    """
    fine = greatest_of_four(steepness(slopes_of(tones_of(scene.fine)[0])))
    steep = np.square(fine) * np.float32(SQUARED["edge"])
    over, around = (distance(cost, scene.patch) for cost in (scene.edge, steep))
    both: Values = np.float32(1 / 2) * (over / np.float32(OVER) + around / np.float32(AROUND))
    return both
