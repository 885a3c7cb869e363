"""Geodesic distances: what must be crossed on the way from the reference patch to a pixel.

A kerb, a line of parked cars or a change of colour is crossed by every path from the ground in
front of the vehicle to what lies behind it, and the cheapest path goes around a mark, a shadow or
a drain. So the distance is small on the road wherever it leads, and grows by a step at its edge.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data import Mask, Rgb
from roadeval.data.arrays import Values
from roadeval.kernels import KERNELS
from roadeval.pipeline.beyond.road_light import LOGS
from roadeval.pipeline.channels import split

GEODESICS: Final = 3
"""Distances of a pixel: over edges, over edges and hues, and over colours."""

ROUNDS: Final = 3
"""Sweeps up and down. More would shorten the path to about one pixel in a hundred by 1 %."""
SCALE: Final = 10_000
"""Of costs as whole numbers: the least has two digits, and the greatest there is fits in 16 bit."""
LENGTH: Final = 10 * SCALE
"""Of a straight step of cost 1, see `roadeval.kernels.plain.geodesics`."""
FLOOR: Final = 0.005
"""Cost of a step on the smoothest ground, so that a longer path costs more."""
OFFSET: Final = 0.05
"""Added before the logarithm: ten steps on smooth ground."""
NOISE: Final = (0.06, 0.02, 0.02)
"""Deviations of log brightness and of two log-chromaticities that any patch may have."""


def geodesics(image: Rgb, patch: Mask) -> Values:
    """Compute the logarithm of geodesic distances from a patch of ``(h, w, 3)`` uint8 RGB.

    The distance is ``min over paths of the integral of c`` (Toivanen 1996, see
    `roadeval.kernels.plain.geodesics`), in pixels, for three costs c of a pixel:
    ``0.005 + g``, ``0.005 + g / 2 + min(h, 10) / 20`` and ``0.005 + 0.03 min(d, 15)``. There g is
    the gradient of the log brightness a pixel, and h and d are the distances of two
    log-chromaticities, and of those and the log brightness, to the patch's medians in deviations
    of the patch (`from_patch`). The result is ``ln(distance + 0.05)``.

    Parameters
    ----------
    image
        ``(h, w, 3)`` uint8 RGB.
    patch
        ``(h, w)`` uint8, nonzero where paths begin; some pixel is.

    Returns
    -------
    numpy.ndarray
        ``(3, h, w)`` float32.
    """
    red, green, blue = (cv2.LUT(plane, LOGS) for plane in split(image))
    light = (red + green + blue) / np.float32(3)
    edge = cv2.magnitude(*(_slope(light, *order) for order in ((1, 0), (0, 1))))
    hue, colour = from_patch((light, red - green, blue - green), patch)
    hue, colour = np.minimum(hue, np.float32(10)), np.minimum(colour, np.float32(15))
    costs = edge, edge / 2 + hue / 20, np.float32(0.03) * colour
    found = np.stack([_lengths(cost, patch) for cost in costs])
    logarithms: Values = np.log(found + np.float32(OFFSET))
    return logarithms


def distance_of(logarithms: Values) -> Values:
    """Return the distances of which `geodesics` are the logarithms."""
    distance: Values = np.exp(logarithms) - np.float32(OFFSET)
    return distance


def from_patch(planes: tuple[Values, Values, Values], patch: Mask) -> tuple[Values, Values]:
    """Return the distance of hues and of colours to those of a patch, ``(h, w)`` float32 each.

    Of log brightness and two log-chromaticities, ``(h, w)`` float32 each, the patch's medians are
    the origin, and 1.48 times its median absolute deviations, plus `NOISE`, the unit: a car or
    paint that covers less than half of the patch moves neither far.
    """
    inside = patch > 0
    squares = []
    for plane, noise in zip(planes, NOISE, strict=True):
        values = plane[inside]
        middle = np.median(values)
        spread = np.float32(1.48) * np.median(np.abs(values - middle)) + np.float32(noise)
        squares.append(np.square((plane - middle) / spread))
    light, first, second = squares
    return np.sqrt(first + second), np.sqrt(light + first + second)


def _slope(light: Values, across: int, down: int) -> Values:
    """Return the slope a pixel of an ``(h, w)`` image in one direction, by Sobel's operator."""
    slope: Values = cv2.Sobel(light, cv2.CV_32F, across, down, scale=1 / 8)
    return slope


def _lengths(cost: Values, patch: Mask) -> npt.NDArray[np.float32]:
    whole = np.rint((cost + np.float32(FLOOR)) * np.float32(SCALE)).astype(np.uint16)
    lengths: Values = KERNELS.geodesics(whole, patch, ROUNDS).astype(np.float32)
    lengths /= np.float32(LENGTH)
    return lengths
