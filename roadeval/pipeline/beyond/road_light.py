"""The colour of a road in the sun and in the shade, learnt from the truth, and its likeness.

A shadowed road is lit by the sky alone: darker, and bluer than the road beside it. In the plane of
log-chromaticities ``(ln R - ln G, ln B - ln G)``, where brightness cancels, lit road is a cloud and
shaded road lies within reach of the segment that leads from the cloud's mean towards skylight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data import Mask, Rgb
from roadeval.data.arrays import Floats
from roadeval.pipeline.parameters import check_arrays, check_covariance, check_range
from roadeval.pipeline.stage import TrainingSet

Map = npt.NDArray[np.float32]

SKYLIGHT: Final = np.array([-0.055, 0.085])
"""From sunlit to shaded road on other drives: bluer."""
SKYLIGHT_WEIGHT: Final = 100
"""Pixels of shaded road that count as much as `SKYLIGHT` does. Drives without shadow have few dark
road pixels, and those are puddles, tar and undersides of cars."""
NOISE: Final = 1e-4
"""Variance of a log-chromaticity that 8-bit JPEG coding alone brings to a mid grey."""

LOGS: Final = np.log(np.arange(256) + 8.0).astype(np.float32)
"""``(256,)`` float32: logarithm of a channel; eight grey levels more keep dark, noisy pixels from
running away."""


@dataclass(frozen=True, slots=True, eq=False)
class RoadLight:
    """What a road looks like in the sun and in the shade, in log-chromaticities.

    Parameters
    ----------
    mean, covariance
        ``(2,)`` and ``(2, 2)``: of sunlit road.
    shift
        ``(2,)``: from there to the mean of shaded road.
    """

    mean: Floats
    covariance: Floats
    shift: Floats

    def __post_init__(self) -> None:
        check_arrays(self, np.float64, mean=(2,), covariance=(2, 2), shift=(2,))
        # No two logarithms of a channel lie further apart than ln(263 / 8) = 3.5.
        check_range("mean", self.mean, -4, 4)
        check_range("shift", self.shift, -8, 8)
        check_range("covariance", self.covariance, -16, 16)
        check_covariance("covariance", self.covariance, 1e-9)


def chromaticity(rgb: npt.NDArray[np.uint8]) -> tuple[Map, Map]:
    """Return ``ln R - ln G`` and ``ln B - ln G`` of ``(H, W, 3)`` uint8, ``(H, W)`` float32."""
    logs = cv2.LUT(rgb, LOGS)
    return logs[..., 0] - logs[..., 1], logs[..., 2] - logs[..., 1]


def fit(sample: TrainingSet) -> RoadLight:
    """Learn the colours of lit and of shaded road from a training set's road pixels.

    Within a frame, road brighter than 0.6 of its own 85th percentile is lit, and road darker
    than 0.5 of it shaded.
    """
    colours, frame = sample.colours()[sample.road], sample.frame[sample.road]
    brightness = colours.mean(axis=1)
    level = np.zeros(len(colours))
    for index in np.unique(frame):
        here = frame == index
        level[here] = np.percentile(brightness[here], 85)
    points = np.stack(chromaticity(colours[None]), axis=-1)[0].astype(np.float64)
    lit, shaded = points[brightness >= 0.6 * level], points[brightness < 0.5 * level]
    mean = lit.mean(axis=0)
    shift = (shaded - mean).sum(axis=0) + SKYLIGHT_WEIGHT * SKYLIGHT
    return RoadLight(
        mean,
        np.cov(lit, rowvar=False, ddof=0) + NOISE * np.eye(2),
        shift / (len(shaded) + SKYLIGHT_WEIGHT),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Likeness:
    """How far each pixel's colour is from the road's; ``(H, W)`` float32, squared Mahalanobis.

    ``lit`` is the distance to sunlit road, ``shaded`` the one to the segment between sunlit and
    shaded road, which is never larger.
    """

    lit: Map
    shaded: Map


def likeness(image: Rgb, road: RoadLight) -> Likeness:
    """Compare the colours of an ``(H, W, 3)`` uint8 RGB image with the road's."""
    # With the covariance's inverse root as a matrix, Mahalanobis distances are Euclidean ones.
    root = np.linalg.cholesky(np.linalg.inv(road.covariance)).T
    red, blue = chromaticity(image)
    across, along = ((red - road.mean[0]), (blue - road.mean[1]))
    u = np.float32(root[0, 0]) * across + np.float32(root[0, 1]) * along
    v = np.float32(root[1, 1]) * along
    step = (root @ road.shift).astype(np.float32)
    length = max(float(step @ step), 1e-12)
    share = np.clip((u * step[0] + v * step[1]) / np.float32(length), 0, 1)
    return Likeness(u * u + v * v, (u - share * step[0]) ** 2 + (v - share * step[1]) ** 2)


def brightness(image: Rgb) -> npt.NDArray[np.uint16]:
    """Return ``R + G + B`` of ``(H, W, 3)`` uint8 RGB, ``(H, W)`` uint16."""
    red, green, blue = cv2.split(image)
    total: npt.NDArray[np.uint16] = cv2.add(
        cv2.add(red, green, dtype=cv2.CV_16U), blue, dtype=cv2.CV_16U
    )
    return total


def excess_green(image: Rgb, total: npt.NDArray[np.uint16]) -> Map:
    """Return ``(2 G - R - B) / (R + G + B)``, ``(H, W)`` float32: high on leaves, 0 for black."""
    green = image[..., 1].astype(np.float32)
    whole = total.astype(np.float32)
    index: Map = cv2.divide(3 * green - whole, np.maximum(whole, 1))
    return index


def quantile(values: npt.NDArray[np.uint16], mask: Mask, share: float) -> int:
    """Return the least value that ``share`` of the masked pixels do not exceed; 0 without any."""
    counted = np.cumsum(np.bincount(values[mask > 0], minlength=1))
    return int(np.searchsorted(counted, share * counted[-1])) if counted[-1] else 0
