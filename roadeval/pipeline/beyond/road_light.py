"""Brightness of pixels, and logarithms of their channels."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb

LOGS: Final = np.log(np.arange(256) + 8.0).astype(np.float32)
"""``(256,)`` float32: logarithm of a channel; eight grey levels more keep dark, noisy pixels from
running away."""


def brightness(image: Rgb) -> npt.NDArray[np.uint16]:
    """Return ``R + G + B`` of ``(H, W, 3)`` uint8 RGB, ``(H, W)`` uint16."""
    red, green, blue = cv2.split(image)
    total: npt.NDArray[np.uint16] = cv2.add(
        cv2.add(red, green, dtype=cv2.CV_16U), blue, dtype=cv2.CV_16U
    )
    return total
