"""Grass that stands: strips of blades which break the edge of the flat lawn."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from benchmarks.world.ground import DRY_GRASS, GRASS
from benchmarks.world.light import Sun
from benchmarks.world.panel import Picture
from benchmarks.world.standing import NO_LEAVES, Standing

PIXELS_PER_METRE: Final = 90.0
HALF_WIDTH: Final = 1.1
HEIGHT: Final = 0.26
BLADES: Final = 700


def grass_strip(sun: Sun, rng: np.random.Generator) -> Standing:
    """Grow a strip of grass across the view, sparse towards its ends and its top."""
    size = round(HEIGHT * PIXELS_PER_METRE), round(2 * HALF_WIDTH * PIXELS_PER_METRE)
    image = np.zeros((*size, 4), np.float32)
    direct = np.zeros(size, np.float32)
    across = np.clip(rng.normal(0.0, 0.42, BLADES), -0.98, 0.98)
    root = rng.uniform(0.0, 0.10, BLADES)
    tip = root + (1 - 0.7 * np.abs(across)) * rng.uniform(0.03, 0.15, BLADES)
    dry = rng.beta(1.2, 3.0, BLADES)[:, None]
    tint = (GRASS + dry * (DRY_GRASS - GRASS)) * rng.uniform(0.6, 1.5, (BLADES, 1))
    facing = rng.uniform(0.3, 1.0, BLADES) * sun.towards[1]
    for i in np.argsort(-root):
        column = (across[i] + 1) * HALF_WIDTH * PIXELS_PER_METRE
        lean = column + rng.normal(0.0, 2.5)
        low, high = (
            (round(c), round((HEIGHT - y) * PIXELS_PER_METRE))
            for c, y in ((column, root[i]), (lean, tip[i]))
        )
        cv2.line(image, low, high, (*tint[i].tolist(), 1.0), 1)
        cv2.line(direct, low, high, float(facing[i]), 1)
    picture = Picture.painted(image, direct, 0.8, 1.0)
    return Standing(picture, HALF_WIDTH, HEIGHT, NO_LEAVES, ())
