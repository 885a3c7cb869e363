"""A training truth for logs that have none: what the ground in front of the vehicle leads to.

The ground right in front of a vehicle is road, and so is what can be reached from there without
crossing much of an edge, as a kerb, a wall or another vehicle has.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from roadeval.data import NON_ROAD, ROAD, Rgb, Truth
from roadeval.pipeline.beyond.exposure import ExposureSettings, expose, gains
from roadeval.pipeline.beyond.features import reach
from roadeval.pipeline.beyond.scene import scene_of, stretched
from roadeval.pipeline.reference_patch import patch_mask
from roadeval.training.settings import TrainingSettings

WIDTH: Final = 160
"""Columns of the working image on which paths are sought."""


def patch_truth(image: Rgb, settings: TrainingSettings) -> Truth:
    """Guess the truth of an ``(H, W, 3)`` uint8 RGB image from its reference patch.

    Road (1) is the patch, and what lies below the horizon row and nearer to it than
    ``settings.far``, see `reach`; all else is not (0). The patch sets the exposure, whatever the
    pipeline sees. Returns ``(H, W)`` uint8.
    """
    height, width = image.shape[:2]
    exposure = ExposureSettings(patch=settings.patch)
    exposed = expose(image, gains(image, exposure), exposure.level)
    near = stretched(reach(scene_of(exposed, WIDTH, settings.patch)), image.shape) < settings.far
    near[: round(settings.horizon * height)] = False
    near |= patch_mask(height, width, settings.patch) > 0
    return np.where(near, np.uint8(ROAD), np.uint8(NON_ROAD))
