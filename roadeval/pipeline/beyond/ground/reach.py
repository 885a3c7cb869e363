"""How far a pixel lies from the reference patch, edges of brightness being what makes a way long.

It needs no training, and most roads end at about the same value, whatever the camera. Hue does not
count: a verge as bright as the road is reached.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.ground.barriers import SQUARED, barriers, greatest_of_four
from roadeval.pipeline.beyond.ground.light import light_over
from roadeval.pipeline.beyond.ground.paths import distance
from roadeval.pipeline.beyond.ground.scene import Scene, tones_of

OVER_EDGES: Final = 1.0
"""Where roads end by the distance over the edges of the working image, which grows with all that is
crossed."""
AROUND_EDGES: Final = 1.5
"""And by that over the squared edges of the image at twice its size, which grows where something
steep is, thin kerbs included. Both values are the best, or next to it, on the train part of IDD
Lite, on CamVid 0016E5 and 0006R0 and on the demo drive; for working images of 160 columns, made of
320 or more: edges of smaller images are blurred, and more is reached. They hold after the stage
`exposure`, which weakens edges among what is brighter than the patch."""
PERCENTILE: Final = 80
"""Of the lower half's log brightness: about that of sunlit ground."""
SHADE, SUN = -0.8, -0.3
"""Of the natural logarithm of brightness over that percentile: at or below `SHADE` a pixel counts
as shade, at or above `SUN` as lit."""
FEATURES: Final = (
    "paths.over_edges",
    "barriers.around_edge",
    f"light.light_over_{PERCENTILE}th_percentile",
)
"""The features that are the two distances and the light of a pixel."""


def reach(scene: Scene) -> Values:
    """Return how far each pixel lies from the patch, ``(h, w)`` float32; roads end at about 1."""
    return combined(*_distances(scene))


def inputs(scene: Scene) -> Sequence[Values]:
    """Compute the planes of `FEATURES`, ``(h, w)`` float32 each."""
    return *_distances(scene), *light_over(scene, PERCENTILE)


def _distances(scene: Scene) -> tuple[Values, Values]:
    edge, *_ = barriers(tones_of(scene.fine))
    steep = np.square(greatest_of_four(edge)) * np.float32(SQUARED["edge"])
    return distance(scene.edge, scene.patch), distance(steep, scene.patch)


def combined(over: Values, around: Values) -> Values:
    """Compute ``d = (over / OVER_EDGES + around / AROUND_EDGES) / 2``, ``(h, w)`` float32, no unit.

    Both are ``(h, w)`` float32: the distances of `FEATURES`, in that order.
    """
    mean: Values = np.float32(1 / 2) * (
        over / np.float32(OVER_EDGES) + around / np.float32(AROUND_EDGES)
    )
    return mean


def lit(light: Values) -> Values:
    """Return the share s of light, which grows from 0 at `SHADE` to 1 at `SUN`.

    ``light`` is the last of `FEATURES`, float32 of any shape.
    """
    share: Values = np.clip((light - np.float32(SHADE)) / np.float32(SUN - SHADE), 0, 1)
    return share


def beyond(far: Values, light: Values) -> Values:
    """Compute ``s max(d - 1, 0)``: how far a pixel lies beyond the road's end, times its light.

    A shadow's edge lengthens the way into it, so that in the shade the distance says little. All
    are ``(h, w)`` float32; d is `combined`, s `lit`, ``light`` the last of `FEATURES`.
    """
    past: Values = lit(light) * np.maximum(far - np.float32(1), 0)
    return past
