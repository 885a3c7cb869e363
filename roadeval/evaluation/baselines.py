"""The baseline: a mask from the training frames' truth alone, whatever the image shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, ROAD, Truth
from roadeval.data.packed import Packed

_NEAREST: Final = 0
_LINEAR: Final = 1
"""OpenCV's numbers for the two, so that importing this module does not import OpenCV."""


@dataclass(frozen=True, slots=True, eq=False)
class BlindPrior:
    """Where the road was in the training frames.

    Parameters
    ----------
    road
        ``(H, W)`` float32: the share of the training frames in which a pixel was road, among
        those that label it; 0 where none does.
    """

    road: npt.NDArray[np.float32]
    _masks: dict[tuple[int, int], Packed] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of_truths(cls, truths: Sequence[Truth]) -> BlindPrior:
        """Average the truths, each ``(H, W)`` uint8 with 255 for ignored.

        Truths of another size than the first are brought to it, nearest pixel.

        Raises
        ------
        ValueError
            If there is none.
        """
        if not truths:
            raise ValueError("a prior needs at least one truth")
        road = np.zeros(truths[0].shape, np.float32)
        labelled = np.zeros_like(road)
        for truth in truths:
            resized = _resized(truth, road.shape, _NEAREST)
            road += resized == ROAD
            labelled += resized != IGNORE
        return cls(np.divide(road, labelled, out=np.zeros_like(road), where=labelled > 0))

    def mask(self, shape: tuple[int, int]) -> Packed:
        """Return the baseline's mask for a frame of ``shape`` (height, width): road from one half.

        It is computed once for a shape, and read-only.
        """
        if shape not in self._masks:
            mask = Packed.of(_resized(self.road, shape, _LINEAR) >= 0.5)
            mask.bits.flags.writeable = False
            self._masks[shape] = mask
        return self._masks[shape]


def _resized(image: npt.NDArray[Any], shape: tuple[int, ...], how: int) -> npt.NDArray[Any]:
    if image.shape == shape:
        return image
    import cv2

    resized: npt.NDArray[Any] = cv2.resize(image, (shape[1], shape[0]), interpolation=how)
    return resized
