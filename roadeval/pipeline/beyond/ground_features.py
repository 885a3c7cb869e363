"""The features of a pixel of the ground: those of some groups, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb
from roadeval.data.arrays import Values
from roadeval.pipeline.beyond import ground
from roadeval.pipeline.beyond.ground.group import Group
from roadeval.pipeline.beyond.ground.scene import Scene
from roadeval.pipeline.training_set import TrainingSet
from roadeval.runtime.discovery import by_name, found_in

Places = npt.NDArray[np.intp]

GROUPS: Final[dict[str, Group]] = by_name(found_in(ground, "GROUP"))
"""By name, in the names' order of their files."""


def names_of(groups: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the features of some groups, with the group's before them."""
    return tuple(f"{name}.{each}" for name in groups for each in GROUPS[name].names)


def features(scene: Scene, groups: Sequence[str]) -> Values:
    """Compute the features of some groups, ``(F, h, w)`` float32 in the order of `names_of`."""
    found: Values = np.empty((len(names_of(groups)), *scene.shape), np.float32)
    planes = (plane for name in groups for plane in GROUPS[name].compute(scene))
    for place, plane in zip(found, planes, strict=True):
        place[...] = plane
    return found


def at_samples(sample: TrainingSet, see: Callable[[Rgb], Values]) -> tuple[Values, Values]:
    """Return the features of the sampled pixels, and of the same in the mirrored images.

    Nothing but habit makes traffic keep to one side: the mirror doubles what there is to learn
    from. Both are ``(n, F)`` float32, in the sample's order; ``see`` returns the features of an
    image, ``(F, h, w)``.
    """
    order, straight, mirrored = [], [], []
    for index, image in enumerate(sample.images):
        here = np.flatnonzero(sample.frame == index)
        row, column = sample.row[here], sample.column[here]
        flipped = np.ascontiguousarray(image[:, ::-1])
        order.append(here)
        straight.append(_at(see(image), image, row, column))
        mirrored.append(_at(see(flipped), image, row, image.shape[1] - 1 - column))
    back = np.argsort(np.concatenate(order))
    return np.concatenate(straight)[back], np.concatenate(mirrored)[back]


def _at(planes: Values, image: Rgb, row: Places, column: Places) -> Values:
    """Return the features ``(n, F)`` of some of the image's pixels."""
    _, height, width = planes.shape
    rows, columns = row * height // image.shape[0], column * width // image.shape[1]
    found: Values = planes[:, rows, columns].T
    return found
