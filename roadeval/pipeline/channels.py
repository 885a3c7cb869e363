"""An image's channels, each an array of its own, as loops over pixels take them."""

from __future__ import annotations

import cv2
import numpy as np

from roadeval.data import Rgb
from roadeval.data.arrays import Planes


def split(image: Rgb) -> Planes:
    """Return red, green and blue of an ``(H, W, 3)`` uint8 image, ``(H, W)`` uint8 each."""
    red, green, blue = channels = [np.empty(image.shape[:2], np.uint8) for _ in range(3)]
    # OpenCV takes three times as long where it allocates the arrays itself.
    cv2.split(image, channels)
    return red, green, blue
