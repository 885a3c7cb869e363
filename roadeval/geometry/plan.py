"""The ground seen from above, in square cells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data.arrays import Matrix, Places
from roadeval.geometry.ground import Ground

OUTSIDE: Final = -1
"""The pixel of a place that the picture does not show."""


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
        """The pixel in which each cell's centre lies, ``(rows, columns)``; `OUTSIDE` of none.

        It is its place in a flat image.
        """
        half = self.width / 2
        ahead = np.arange(self.far - self.cell / 2, self.near, -self.cell)
        left = np.arange(half - self.cell / 2, -half, -self.cell)
        places = np.stack(np.meshgrid(ahead, left, indexing="ij"), axis=-1)
        return pixels_of(self.ground, places.reshape(-1, 2)).reshape(places.shape[:2])

    def picture(self, image: npt.NDArray[Any], nothing: int = 0) -> npt.NDArray[Any]:
        """Return an ``(H, W, ...)`` image as it looks from above, ``nothing`` where it is not seen.

        The nearest pixel is taken.
        """
        picture = image.reshape(-1, *image.shape[2:]).take(self.cells, axis=0)
        picture[self.cells == OUTSIDE] = nothing
        return picture


def pixels_of(ground: Ground, places: Matrix) -> Places:
    """Return the pixel in which each place lies, ``(n,)`` in a flat image; `OUTSIDE` of none."""
    pixels = np.rint(ground.pixels(places))
    size = ground.width, ground.height
    inside = np.all((pixels >= 0) & (pixels < size), axis=1, keepdims=True)
    columns, rows = np.where(inside, pixels, 0).astype(np.intp).T
    return np.where(inside[:, 0], rows * ground.width + columns, OUTSIDE)
