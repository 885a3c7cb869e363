"""The working image, on which texture means the same for every camera, and ways from and to it.

A `Scene` is what all features of a frame share.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from roadeval.data import Mask, Rgb
from roadeval.data.arrays import Values
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.pipeline.stage import split

NOISE: Final = (0.06, 0.02, 0.02)
"""Deviations of log brightness and of two log-chromaticities that any patch may have."""
LOGS: Final = np.log(np.arange(256) + 8.0).astype(np.float32)
"""``(256,)`` float32: logarithm of a channel; eight grey levels more keep dark, noisy pixels from
running away."""

Tones = tuple[Values, Values, Values]
"""Log brightness ``(ln R + ln G + ln B) / 3``, and the log-chromaticities ``ln R - ln G`` and
``ln B - ln G``, in which brightness cancels; ``(h, w)`` float32 each."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A frame as its features see it."""

    image: Rgb
    """``(h, w, 3)`` uint8 RGB: the working image."""
    fine: Rgb
    """``(2 h, 2 w, 3)`` uint8 RGB: the same at twice the size, where thin things survive."""
    patch: Mask
    """``(h, w)`` uint8: the reference patch, nonzero inside."""
    tones: Tones
    """Of the working image."""
    middle: tuple[float, ...]
    """The patch's median of each tone."""
    hue: Values
    """Distance of the log-chromaticities to the patch's medians, in the patch's deviations."""
    colour: Values
    """Distance of all three tones to them, likewise."""
    slopes: tuple[Values, Values]
    """Of the log brightness a pixel across and down, by Sobel's operator."""
    edge: Values
    """Their magnitude."""

    @classmethod
    def of(cls, image: Rgb, fine: Rgb, patch: ReferencePatch) -> Scene:
        """Look at an image, and at the same at twice its size."""
        tones, area = tones_of(image), patch_mask(*image.shape[:2], patch)
        middle, hue, colour = from_patch(tones, area)
        slopes = slopes_of(tones[0])
        return cls(image, fine, area, tones, middle, hue, colour, slopes, steepness(slopes))

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width."""
        return self.edge.shape


def scene_of(image: Rgb, width: int, patch: ReferencePatch) -> Scene:
    """Look at an ``(H, W, 3)`` uint8 RGB image on a working image of ``width`` columns."""
    height = max(1, round(image.shape[0] * width / image.shape[1]))
    way = cv2.INTER_AREA if image.shape[1] >= 2 * width else cv2.INTER_LINEAR
    fine = cv2.resize(image, (2 * width, 2 * height), interpolation=way)
    small = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)
    return Scene.of(small, fine, patch)


def tones_of(image: Rgb) -> Tones:
    """Return the tones of ``(h, w, 3)`` uint8 RGB."""
    red, green, blue = (cv2.LUT(plane, LOGS) for plane in split(image))
    return (red + green + blue) / np.float32(3), red - green, blue - green


def from_patch(tones: Tones, patch: Mask) -> tuple[tuple[float, ...], Values, Values]:
    """Return a patch's medians, and each pixel's distance of hues and of colours to them.

    1.48 times the patch's median absolute deviations, plus `NOISE`, are the unit: a car or paint
    that covers less than half of the patch moves neither far.
    """
    inside = patch > 0
    medians, squares = [], []
    for plane, noise in zip(tones, NOISE, strict=True):
        values = plane[inside]
        middle = np.median(values)
        spread = np.float32(1.48) * np.median(np.abs(values - middle)) + np.float32(noise)
        medians.append(float(middle))
        squares.append(np.square((plane - middle) / spread))
    light, first, second = squares
    return tuple(medians), np.sqrt(first + second), np.sqrt(light + first + second)


def slopes_of(plane: Values) -> tuple[Values, Values]:
    """Return the slopes a pixel of an ``(h, w)`` image across and down, by Sobel's operator."""
    return (
        cv2.Sobel(plane, cv2.CV_32F, 1, 0, scale=1 / 8),
        cv2.Sobel(plane, cv2.CV_32F, 0, 1, scale=1 / 8),
    )


def steepness(slopes: tuple[Values, Values]) -> Values:
    """Return the magnitude of slopes.

    OpenCV's rounds otherwise where an array begins elsewhere in memory, and the same frame would
    not give the same features twice.
    """
    across, down = slopes
    magnitude: Values = np.sqrt(across * across + down * down)
    return magnitude


def mean(plane: Values, side: int) -> Values:
    """Return an ``(h, w)`` image's means over squares."""
    blurred: Values = cv2.blur(plane, (side, side))
    return blurred


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


def stretched(values: Values, shape: tuple[int, ...]) -> Values:
    """Resize float32 values to the height and width of ``shape``, interpolated linearly."""
    large: Values = cv2.resize(values, (shape[1], shape[0]))
    return large
