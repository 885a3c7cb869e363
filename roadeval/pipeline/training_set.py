"""The training set: labelled pixels that a stage learns from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb


@dataclass(frozen=True, slots=True, eq=False)
class TrainingSet:
    """Labelled pixels of some frames, as one variant's filters left them.

    Parameters
    ----------
    images
        The training frames, each ``(H, W, 3)`` uint8 RGB.
    frame, row, column
        ``(n,)`` integers: where each sampled pixel lies.
    road
        ``(n,)`` bool: its label.
    seed
        For whatever a fit draws at random.
    share
        Of road among the labelled pixels of the frames, from which as many pixels of road as of
        the rest are sampled; None where the labels are a guess, whose share is not to be trusted.
    """

    images: tuple[Rgb, ...]
    frame: npt.NDArray[np.intp]
    row: npt.NDArray[np.intp]
    column: npt.NDArray[np.intp]
    road: npt.NDArray[np.bool_]
    seed: int = 0
    share: float | None = None

    def colours(self) -> npt.NDArray[np.uint8]:
        """Return the colours of the sampled pixels, ``(n, 3)`` uint8 RGB."""
        colours = np.empty((len(self.road), 3), np.uint8)
        for index, image in enumerate(self.images):
            here = self.frame == index
            colours[here] = image[self.row[here], self.column[here]]
        return colours
