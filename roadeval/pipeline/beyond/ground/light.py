"""Brightness held against the frame's own: a second exposure that does not trust the patch.

Where the patch lies in the shade of a lorry, the sunlit road is too bright for it, but not for the
lower half of the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.ground.group import Group
from roadeval.pipeline.beyond.ground.scene import Scene

PERCENTILES: Final = (50, 80)
"""Of the log brightness in the lower half."""


def compute(scene: Scene) -> Sequence[Values]:
    """Return log brightness less the lower half's, and the row's; and the row's median colour."""
    light = scene.tones[0]
    row = light - light.mean(axis=1, keepdims=True)
    return [*light_over(scene, *PERCENTILES), row, np.median(scene.colour, axis=1, keepdims=True)]


def light_over(scene: Scene, *percentiles: float) -> Sequence[Values]:
    """Return log brightness less each percentile of the lower half's, ``(h, w)`` float32."""
    light = scene.tones[0]
    levels = np.percentile(light[scene.shape[0] // 2 :], percentiles)
    return [light - np.float32(level) for level in levels]


GROUP: Final = Group(
    "light",
    (
        *(f"light_over_{each}th_percentile" for each in PERCENTILES),
        *("light_over_row", "colour_distance_of_row"),
    ),
    compute,
)
