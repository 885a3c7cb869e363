"""A training truth for logs that have none: the ground right in front of the vehicle is road."""

from __future__ import annotations

import numpy as np

from roadeval.data import IGNORE, NON_ROAD, ROAD, Rgb, Truth
from roadeval.kernels import KERNELS
from roadeval.pipeline.channels import split
from roadeval.pipeline.paper.similarity import limit, whitening
from roadeval.pipeline.reference_patch import patch_mask
from roadeval.training.settings import TrainingSettings


def patch_truth(image: Rgb, settings: TrainingSettings) -> Truth:
    """Guess the truth of an ``(H, W, 3)`` uint8 RGB image from its reference patch.

    Road (1) is the patch; non-road (0) whatever lies above the horizon row, or further from
    the patch's colours than their ``far`` quantile (Mahalanobis, Eq. 2); the rest is undecided
    (255) and trains nothing. Returns ``(H, W)`` uint8.
    """
    height, width = image.shape[:2]
    patch = patch_mask(height, width, settings.patch) > 0
    colours = image[patch].astype(np.float64)
    factors = whitening(np.cov(colours, rowvar=False, ddof=0) + np.eye(3))
    mean, far = colours.mean(axis=0), limit(settings.far)
    _, near = KERNELS.mahalanobis(split(image), mean, factors, far)
    truth = np.full((height, width), IGNORE, np.uint8)
    truth[near == 0] = NON_ROAD
    truth[: round(settings.horizon * height)] = NON_ROAD
    truth[patch] = ROAD
    return truth
