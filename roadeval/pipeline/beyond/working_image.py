"""The working image: a reduced one, on which texture means the same for every camera."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data import Mask, Rgb


def reduced(image: Rgb, width: int) -> Rgb:
    """Reduce an ``(H, W, 3)`` uint8 image to ``width`` columns by area means; never enlarge it."""
    if image.shape[1] <= width:
        return image
    height = max(1, round(image.shape[0] * width / image.shape[1]))
    small: Rgb = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return small


def enlarged(mask: Mask, shape: tuple[int, ...]) -> Mask:
    """Resize a mask or label image to the height and width of ``shape``, to the nearest pixel."""
    large: Mask = cv2.resize(mask, (shape[1], shape[0]), interpolation=cv2.INTER_NEAREST_EXACT)
    return large


def stretched(values: npt.NDArray[np.float32], shape: tuple[int, ...]) -> npt.NDArray[np.float32]:
    """Resize float32 values to the height and width of ``shape``, interpolated linearly."""
    large: npt.NDArray[np.float32] = cv2.resize(values, (shape[1], shape[0]))
    return large
