"""Where a pixel lies in the image."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np

from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.ground.group import Group
from roadeval.pipeline.beyond.ground.scene import Scene


def compute(scene: Scene) -> Sequence[Values]:
    """Return column (-1 to 1), its magnitude, and row (0 to 1) of each pixel's centre."""
    return _coordinates(*scene.shape)


@lru_cache(maxsize=8)
def _coordinates(height: int, width: int) -> tuple[Values, Values, Values]:
    across = (np.arange(width, dtype=np.float32) + np.float32(0.5)) * np.float32(2 / width) - 1
    down = (np.arange(height, dtype=np.float32) + np.float32(0.5)) / np.float32(height)
    return across[None], np.abs(across)[None], down[:, None]


GROUP: Final = Group("place", ("across", "from_middle", "down"), compute)
