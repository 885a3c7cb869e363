"""Features of a pixel: its colour, its place, the column below it, and the texture around it.

Geodesic distances from the reference patch, where they are wanted, are added to them.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import cv2
import numpy as np

from roadeval.data import Rgb
from roadeval.data.arrays import Values
from roadeval.pipeline.beyond.geodesic_features import GEODESICS, geodesics
from roadeval.pipeline.beyond.road_light import LOGS
from roadeval.pipeline.beyond.working_image import reduced
from roadeval.pipeline.channels import split
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.pipeline.training_set import TrainingSet

BARE_FEATURES: Final = 9
"""Features apart from texture: three colours, two log-chromaticities, two coordinates, and two of
the column below."""


def number_of_features(windows: tuple[int, ...], patch: ReferencePatch | None = None) -> int:
    """Return how many `features` there are."""
    return BARE_FEATURES + 2 * len(windows) + (0 if patch is None else GEODESICS)


def features(image: Rgb, windows: tuple[int, ...], patch: ReferencePatch | None = None) -> Values:
    """Compute colour, chromaticity, place, column and texture of ``(h, w, 3)`` uint8 RGB.

    Returns ``(F, h, w)`` float32, with the `geodesics` from a patch, if one is given, last. The
    column is what `_columns` finds below a pixel. Texture is,
    for each window, the root of the mean absolute slope of the log brightness across and down:
    kerbs, wheels and house fronts have edges of one direction, leaves of both.
    """
    colours = split(image)
    red, green, blue = (cv2.LUT(plane, LOGS) for plane in colours)
    light = (red + green + blue) / np.float32(3)
    slopes = [np.abs(cv2.Sobel(light, cv2.CV_32F, *order)) for order in ((1, 0), (0, 1))]
    size = number_of_features(windows, patch)
    found: Values = np.empty((size, *image.shape[:2]), np.float32)
    found[:3] = colours
    np.subtract(red, green, out=found[3])
    np.subtract(blue, green, out=found[4])
    found[5:7] = _coordinates(*image.shape[:2])
    _columns(light, slopes[1], found[7:9])
    textures = (cv2.blur(slope, (side, side)) for side in windows for slope in slopes)
    for plane, texture in zip(found[9 : 9 + 2 * len(windows)], textures, strict=True):
        np.sqrt(texture, out=plane)
    if patch is not None:
        found[-GEODESICS:] = geodesics(image, patch_mask(*image.shape[:2], patch))
    return found


def _columns(light: Values, slope: Values, found: Values) -> None:
    """Fill ``found``, ``(2, h, w)``, with what lies between each pixel and the image's lower edge.

    The steepest edge across the column, as the root of the mean absolute slope down of a few
    pixels, and the least log brightness: whoever drives up the column to the pixel meets no kerb
    and no shadow under a car as long as there is road. ``light`` and ``slope`` are ``(h, w)``
    float32.
    """
    edge, dark = found
    np.sqrt(cv2.blur(slope, (5, 3)), out=edge)
    cv2.blur(light, (5, 5), dst=dark)
    np.maximum.accumulate(edge[::-1], axis=0, out=edge[::-1])
    np.minimum.accumulate(dark[::-1], axis=0, out=dark[::-1])


@lru_cache(maxsize=8)
def _coordinates(height: int, width: int) -> tuple[Values, Values]:
    """Return column (-1 to 1) and row (0 to 1) of each pixel's centre, ``(height, width)`` each."""
    down, across = np.mgrid[0:height, 0:width].astype(np.float32) + np.float32(0.5)
    return across * np.float32(2 / width) - 1, down / np.float32(height)


def at_samples(
    sample: TrainingSet, width: int, windows: tuple[int, ...], patch: ReferencePatch | None = None
) -> Values:
    """Return the features of the sampled pixels, ``(n, F)`` float32."""
    rows = []
    for index, image in enumerate(sample.images):
        here = sample.frame == index
        small = features(reduced(image, width), windows, patch)
        rows_small, columns_small = small.shape[1:]  # of this image: `width` bounds them all
        row = sample.row[here] * rows_small // image.shape[0]
        column = sample.column[here] * columns_small // image.shape[1]
        rows.append((np.flatnonzero(here), small[:, row, column].T))
    order = np.concatenate([where for where, _ in rows])
    result: Values = np.concatenate([values for _, values in rows])[np.argsort(order)]
    return result
