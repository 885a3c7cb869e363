"""How far a pixel lies from the reference patch, if nothing is crossed that bounds a road.

One number that needs no training, and by which most roads end at the same value, whatever the
camera: the mean of two geodesic distances, each over the threshold at which roads end.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.ground.barriers import SQUARED, greatest_of_four
from roadeval.pipeline.beyond.ground.paths import distance
from roadeval.pipeline.beyond.ground.scene import Scene, slopes_of, steepness, tones_of

OVER_EDGES: Final = 1.2
AROUND_EDGES: Final = 2.0
"""The thresholds: the best, or next to it, on the train part of IDD Lite, on two of CamVid's drives
and on a rendered one."""


def reach(scene: Scene) -> Values:
    """Return how far each pixel lies from the patch, ``(h, w)`` float32; roads end at about 1."""
    fine = greatest_of_four(steepness(slopes_of(tones_of(scene.fine)[0])))
    around = distance(np.square(fine) * np.float32(SQUARED["edge"]), scene.patch)
    return combined(distance(scene.edge, scene.patch), around)


def combined(over: Values, around: Values) -> Values:
    """Return the same from two distances, each the one of its name.

    The first is that over the edges of the working image, and grows with all that is crossed; the
    second that over the squared ones of the image at twice its size, and grows where something
    steep is, thin kerbs included: `paths.over_edges` and `barriers.around_edge` of the features.
    """
    mean: Values = np.float32(1 / 2) * (
        over / np.float32(OVER_EDGES) + around / np.float32(AROUND_EDGES)
    )
    return mean
