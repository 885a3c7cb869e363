"""Values of the working image brought to the camera's pixels, with edges where its image has them.

Fast guided filter [1]_ [2]_: around each pixel of the working image the values are fitted by a line
of its brightness, ``p = a I + b``. The means of ``a`` and ``b`` over the windows that hold a pixel
are enlarged, and the line is applied to the brightness of the camera's image.

References
----------
.. [1] K. He, J. Sun, X. Tang, Guided Image Filtering, IEEE Transactions on Pattern Analysis and
   Machine Intelligence 35 (2013), equations 5, 6 and 8.
.. [2] K. He, J. Sun, Fast Guided Filter, arXiv:1505.00996 (2015).
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from roadeval.data import Rgb
from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.working_image import stretched

SIDE: Final = 3
"""Of a window, in pixels of the working image."""
CONTRAST: Final = 16.0
"""Grey levels: where brightness varies by so much in a window (one standard deviation), half of
what it and the values have in common is kept as an edge. From 8 to 25 errors on IDD and CamVid are
the same within a hundredth of a point."""


def guided(values: Values, working: Rgb, image: Rgb) -> Values:
    """Bring values to the size of an image, ``(H, W)`` float32.

    An image that is smaller than the working image gives no edges; the values are smoothed.

    In a window with means ``m`` of brightness and ``q`` of the values,
    ``a = (mean(I p) - m q) / (var(I) + CONTRAST^2)`` and ``b = q - a m``. The result may lie beyond
    the range of the values.

    Parameters
    ----------
    values
        ``(h, w)`` float32.
    working, image
        The working image, ``(h, w, 3)``, and the camera's, ``(H, W, 3)`` uint8 RGB.
    """
    grey = _brightness(working)
    level, value = _mean(grey), _mean(values)
    spread = _mean(grey * grey) - level * level
    common = _mean(grey * values) - level * value
    slope: Values = np.divide(common, spread + np.float32(CONTRAST**2))
    offset: Values = value - slope * level
    shape = image.shape
    found: Values = _brightness(image)
    found *= stretched(_mean(slope), shape)
    found += stretched(_mean(offset), shape)
    return found


def _brightness(image: Rgb) -> Values:
    grey: Values = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    return grey


def _mean(plane: Values) -> Values:
    means: Values = cv2.blur(plane, (SIDE, SIDE))
    return means
