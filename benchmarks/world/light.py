"""Daylight: a direct sun, a bluish sky, and a cloud that may come between.

Radiance and irradiance share one unit: a white horizontal surface under the clear sun and the
whole sky has a green radiance of about 1, so a surface's radiance is its reflectance times
the light that falls on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.world.noise import Field
from roadeval.data import Mask
from roadeval.data.arrays import Floats

SUN_RADIUS: Final = np.radians(0.2665)
"""Angular radius of the sun's disc as seen from the Earth."""
SUN: Final = np.array([1.26, 1.15, 0.98], np.float32)
"""Irradiance of a surface that faces the clear sun: slightly warm."""
SKY: Final = np.array([0.150, 0.182, 0.235], np.float32)
"""Irradiance of open level ground from the clear sky alone: bluish."""
CLOUD: Final = np.array([0.215, 0.212, 0.205], np.float32)
"""Light that a cloud before the sun adds to the sky's: nearly grey."""
THICK: Final = 0.015
"""Share of the direct beam that the cloud lets through."""

SHADOW_VISIBILITY: Final = 0.5
"""True shadow: less than this share of the sun's disc is seen from the surface ..."""
CASTING_BEAM: Final = 0.1
"""... while at least this share of the beam gets past the clouds; a dimmer sun casts none."""


@dataclass(frozen=True, slots=True)
class Sun:
    """Where the sun stands, radians; azimuth from straight ahead (+Z), positive to the right."""

    elevation: float
    azimuth: float

    @property
    def towards(self) -> Floats:
        """``(3,)`` unit vector that points at the sun."""
        level = np.cos(self.elevation)
        return np.array(
            [level * np.sin(self.azimuth), np.sin(self.elevation), level * np.cos(self.azimuth)]
        )

    def shadow_of(self, points: Floats) -> Floats:
        """``(n, 2)`` ground X and Z where ``(n, 3)`` points cast their shadow."""
        towards = self.towards
        return np.asarray(points[:, [0, 2]] - points[:, 1:2] * towards[[0, 2]] / towards[1])

    def facing(self, normal: Floats) -> float:
        """Cosine between a surface's normal and the sun, 0 if it faces away."""
        return max(0.0, float(normal @ self.towards))


@dataclass(frozen=True, slots=True)
class Light:
    """The daylight of a moment: ``(3,)`` float32 RGB irradiances and the share of the beam.

    ``direct`` falls on a surface that faces the sun, ``sky`` on open level ground.
    """

    direct: Field
    sky: Field
    beam: float

    @property
    def casts(self) -> bool:
        """Whether the sun is bright enough for its shadows to count as shadow."""
        return self.beam >= CASTING_BEAM


def daylight(beam: float) -> Light:
    """Return the light when the share ``beam`` of the direct sun gets past the clouds."""
    return Light(np.float32(beam) * SUN, SKY + np.float32(1.0 - beam) * CLOUD, beam)


def is_shadow(visible: Field, light: Light) -> Mask:
    """Return true shadow from the share of the sun's disc that each pixel's surface sees.

    Parameters
    ----------
    visible
        ``(H, W)`` float32, 0 (sun hidden, or surface turned away) to 1.
    light
        The light of the moment.

    Returns
    -------
    ndarray
        ``(H, W)`` uint8, 1 for shadow.
    """
    return np.asarray((visible < SHADOW_VISIBILITY) & light.casts, np.uint8)
