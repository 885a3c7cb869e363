"""A view of the ground from above, in square cells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data.arrays import Floats, Places
from roadeval.geometry.ground import Ground

OUTSIDE: Final = -1
"""Stands for the pixel of a place outside the picture."""


@dataclass(frozen=True)
class Plan:
    """A rectangle of ground before the camera. Far ahead is at the top, left is left."""

    ground: Ground
    near: float
    far: float
    """Metres ahead of the camera at which it begins and ends."""
    width: float
    """Metres across, half of them to either side."""
    cell: float
    """Metres of a cell's side."""

    @cached_property
    def cells(self) -> Places:
        """``(rows, columns)`` pixels of the cells' centres in a flat image, or `OUTSIDE`."""
        half = self.width / 2
        ahead = np.arange(self.far - self.cell / 2, self.near, -self.cell)
        left = np.arange(half - self.cell / 2, -half, -self.cell)
        places = np.stack(np.meshgrid(ahead, left, indexing="ij"), axis=-1)
        return pixels_of(self.ground, places.reshape(-1, 2)).reshape(places.shape[:2])

    def picture(self, image: npt.NDArray[Any], nothing: int = 0) -> npt.NDArray[Any]:
        """Return an image as seen from above, by the nearest pixels; ``nothing`` outside it."""
        picture = image.reshape(-1, *image.shape[2:]).take(self.cells, axis=0)
        picture[self.cells == OUTSIDE] = nothing
        return picture


def pixels_of(ground: Ground, places: Floats) -> Places:
    """Return the pixel of each place, ``(n,)`` indices of a flat image, or `OUTSIDE`."""
    pixels = np.rint(ground.pixels(places))
    size = ground.width, ground.height
    inside = np.all((pixels >= 0) & (pixels < size), axis=1, keepdims=True)
    columns, rows = np.where(inside, pixels, 0).astype(np.intp).T
    return np.where(inside[:, 0], rows * ground.width + columns, OUTSIDE)
