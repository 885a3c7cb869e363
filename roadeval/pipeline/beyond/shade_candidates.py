"""Dark pixels where road may be, and what is known of them.

All brightness is relative to the frame's own sunlit road, so that it holds for any exposure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as validated

from roadeval.data import Mask, Rgb
from roadeval.data.arrays import Floats, Values
from roadeval.pipeline.beyond.ground import paths
from roadeval.pipeline.beyond.ground.scene import (
    Scene,
    from_patch,
    mean,
    slopes_of,
    steepness,
    tones_of,
)
from roadeval.pipeline.beyond.road_light import brightness
from roadeval.pipeline.reference_patch import ReferencePatch, Share, patch_mask

GRID: Final = (12, 16)
"""Rows and columns of the cells by which the place of road is learnt."""
WINDOWS: Final = (3, 9)
"""Sides of the squares over which texture is averaged."""
PATCH: Final = ReferencePatch()
FEATURES: Final = 13 + 2 * len(WINDOWS)
"""Of a pixel, see `features_of`."""
STEPS: Final = 0.05
"""Added to a geodesic distance before the logarithm: ten steps on smooth ground."""
LEVEL: Final = 0.85
"""The frame's sunlit level is this quantile of the brightness of where road is likely."""
LIT: Final = 0.7
"""Lit road is brighter than this share of the sunlit level."""
OFFSET: Final = np.float32(8)
"""Added to a channel before ratios are taken, as in `LOGS`."""


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class GatedSettings:
    """Settings of the gated filter. Lengths are in pixels of the working image."""

    width: Annotated[int, Field(ge=32, le=4096)] = 160
    """Of the working image: wider ones are reduced to it for all that is decided. Texture then
    means the same for every camera, and the time is the same too."""
    darkness: Share = 0.6
    """Candidates are darker than this share of the sunlit level."""
    place: Share = 0.05
    """Candidates lie where at least this share of the training pixels is road: sky, trees and
    houses are elsewhere."""
    planes: Annotated[int, Field(ge=1, le=4096)] = 128
    """Planes of the feature map on which the odds are learnt. What a frame costs grows with them.
    """
    penalty: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 0.01
    """Of the squared weights, a training pixel."""
    odds: Annotated[float, Field(gt=0, le=1e6)] = 0.1
    """Factor of the odds that a candidate is shaded road. The more, the more dark road comes back,
    and the more is brightened that is none. A classifier on colours takes all of that for road,
    and wants caution; one that sees place and surroundings as well takes 1."""
    least: Annotated[float, Field(ge=0, lt=1)] = 0.1
    """Below this probability nothing is brightened."""
    window: Annotated[int, Field(ge=1, le=99)] = 1
    """Side of the square over which a candidate's own colour is averaged: texture finer than it
    stays."""
    greatest: Annotated[float, Field(ge=1, le=255)] = 8.0
    """Greatest gain of a channel."""
    softness: Annotated[int, Field(ge=1, le=99)] = 3
    """Side of the square that the gains are averaged over, so that edges stay soft."""


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A working image as the filter sees it."""

    image: Rgb
    """``(h, w, 3)`` uint8 RGB."""
    level: float
    """Sunlit level of ``R + G + B``."""
    lit: Floats
    """``(3,)``: mean colour of lit road."""
    place: Values
    """``(h, w)`` float32: the road's share by place."""
    likely: npt.NDArray[np.bool_]
    """``(h, w)``: whether that is more than half."""
    candidates: npt.NDArray[np.bool_]
    """``(h, w)`` bool."""


def look(image: Rgb, place: Floats, settings: GatedSettings) -> Look:
    """Find the sunlit level, lit road's colour and the candidates of a working image.

    Where road is likely by its place alone, nearly every frame has some that is lit: that level is
    within a tenth of the true one, where the colour of road finds a third.
    """
    height, width = image.shape[:2]
    total = brightness(image)
    share: Values = cv2.resize(place.astype(np.float32), (width, height))
    likely = share > 0.5
    level = _quantile(total[likely], share[likely], LEVEL)
    shining = likely & (total >= LIT * level)
    lit = np.asarray(cv2.mean(image, shining.view(np.uint8))[:3])
    candidates = (total < settings.darkness * level) & (share > settings.place)
    return Look(image, level, lit, share, likely, candidates)


def _quantile(values: npt.NDArray[np.uint16], weights: Values, share: float) -> float:
    """Return the least value that holds, with those below it, a share of the weight; 0 for none."""
    counted = np.cumsum(np.bincount(values, weights, minlength=1))
    return float(np.searchsorted(counted, share * counted[-1])) if counted[-1] > 0 else 0.0


def features_of(seen: Look) -> Values:
    """Compute the features of every pixel, ``(F, h, w)`` float32.

    Log brightness and two log-chromaticities relative to those of lit road; the two as they are;
    the distance from the middle column, and the row; the steepest edge across the column below and
    the darkest in it, relative to the sunlit level; texture, for each window the root of the mean
    absolute slope across and down; the logarithms of the geodesic distances from the reference
    patch (`ground.paths`); and the road's share by place.
    """
    scene = _scene(seen.image)
    light, red, blue = scene.tones
    top = np.float32(np.log(seen.level / 3 + OFFSET))
    lit = np.log(seen.lit + OFFSET).astype(np.float32)
    down, across = np.mgrid[: scene.shape[0], : scene.shape[1]].astype(np.float32) + np.float32(0.5)
    slopes = [np.abs(slope) for slope in scene.slopes]
    met = np.sqrt(cv2.blur(slopes[1], (5, 3))), mean(light, 5) - top
    found: Values = np.stack(
        [
            light - top,
            red - (lit[0] - lit[1]),
            blue - (lit[2] - lit[1]),
            red,
            blue,
            np.abs(across * np.float32(2 / scene.shape[1]) - 1),
            down / np.float32(scene.shape[0]),
            np.maximum.accumulate(met[0][::-1])[::-1],
            np.minimum.accumulate(met[1][::-1])[::-1],
            *(np.sqrt(mean(slope, side)) for side in WINDOWS for slope in slopes),
            *(np.log(far + np.float32(STEPS)) for far in paths.compute(scene)),
            seen.place,
        ]
    )
    return found


def _scene(image: Rgb) -> Scene:
    """Look at a working image as it is; nothing of it is looked at twice as large."""
    tones, area = tones_of(image), patch_mask(*image.shape[:2], PATCH)
    middle, hue, colour = from_patch(tones, area)
    slopes = slopes_of(tones[0])
    return Scene(image, image, area, tones, middle, hue, colour, slopes, steepness(slopes))


def as_told(seen: Look, shadow: Mask) -> Look:
    """Return the look with true shadow for candidates."""
    return Look(seen.image, seen.level, seen.lit, seen.place, seen.likely, shadow > 0)
