"""Which pixels train: as many of road as of the rest, drawn with a seed, and bounded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from roadeval.data import NON_ROAD, ROAD, Truth
from roadeval.training.settings import TrainingSettings

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Pixels:
    """Where the sampled pixels lie, ``(n,)`` each, and which are road, ``(n,)`` bool."""

    frame: Indices
    row: Indices
    column: Indices
    road: npt.NDArray[np.bool_]


def sample(truths: Sequence[Truth], settings: TrainingSettings) -> Pixels:
    """Draw pixels of both classes from the truths of the training frames.

    Each frame gives at most ``pixels_per_class`` of either class; then the class that has more
    is thinned to the size of the other, so that the sample is balanced however little road (or
    sky) a frame shows. Ignored pixels are never drawn. The same truths and settings give the
    same pixels.
    """
    rng = np.random.default_rng(settings.seed)
    share = max(1, min(settings.pixels_per_class, settings.max_pixels // (2 * len(truths))))
    classes = [_draw(truths, value, share, rng) for value in (ROAD, NON_ROAD)]
    size = min(*(len(drawn) for drawn in classes), settings.max_pixels // 2)
    road, other = (drawn[np.sort(rng.permutation(len(drawn))[:size])] for drawn in classes)
    places = np.concatenate([road, other])
    return Pixels(places[:, 0], places[:, 1], places[:, 2], np.arange(len(places)) < len(road))


def _draw(
    truths: Sequence[Truth], value: int, share: int, rng: np.random.Generator
) -> npt.NDArray[np.intp]:
    drawn = []
    for index, truth in enumerate(truths):
        flat = np.flatnonzero(truth == value)
        chosen = rng.choice(flat, min(share, len(flat)), replace=False)
        rows, columns = np.unravel_index(np.sort(chosen), truth.shape)
        drawn.append(np.stack([np.full(len(chosen), index), rows, columns], axis=1))
    return np.concatenate(drawn).astype(np.intp)
