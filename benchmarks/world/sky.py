"""The background: sky, fair-weather clouds, far hills and a line of far trees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from benchmarks.world.light import Sun
from benchmarks.world.noise import Field, coloured_noise, smoothstep

HORIZON: Final = np.array([0.52, 0.58, 0.64], np.float32)
ZENITH: Final = np.array([0.10, 0.19, 0.40], np.float32)
"""Radiance of the clear sky; the horizon's is the air's own and tints distant things."""
CLOUD_TOP: Final = np.array([1.00, 0.99, 0.97], np.float32)
CLOUD_BASE: Final = np.array([0.50, 0.53, 0.57], np.float32)
HILLS: Final = np.array([0.20, 0.25, 0.28], np.float32)
TREES: Final = np.array([0.075, 0.095, 0.055], np.float32)
CLOUD_PIXELS: Final = 512
CLOUD_SCALE: Final = 26.0
"""Pixels of the cloud texture to one cloud height along the ground."""
SKYLINE_COLUMNS: Final = 4096
"""Samples of the skylines over a full turn."""
SKYLINE_SHARPNESS: Final = 0.0016
"""Over how many radians of elevation a skyline fades: about a pixel."""


def air(beam: float) -> Field:
    """``(3,)`` radiance of the air before distant things, for a share of the sun's beam."""
    return np.asarray(HORIZON * np.float32(0.4 + 0.6 * beam))


@dataclass(frozen=True, slots=True, eq=False)
class Sky:
    """The far view.

    ``clouds`` is ``(n, n)``, periodic; ``hills`` and ``trees`` are ``(m,)`` skylines, the
    tangent of the elevation by azimuth, straight ahead in the middle.
    """

    sun: Sun
    clouds: Field
    hills: Field
    trees: Field

    @classmethod
    def painted(cls, sun: Sun, rng: np.random.Generator) -> Sky:
        """Draw clouds and skylines."""
        clouds = coloured_noise(rng, (CLOUD_PIXELS, CLOUD_PIXELS), 2, 120, 1.35)
        low = coloured_noise(rng, (1, SKYLINE_COLUMNS), 60, 900, 1.0)[0]
        bumps = coloured_noise(rng, (1, SKYLINE_COLUMNS), 2, 60, 0.5)[0]
        hills = 0.030 + 0.014 * low
        trees = 0.021 + 0.0032 * bumps + 0.004 * np.roll(low, 300)
        return cls(sun, clouds, np.asarray(hills, np.float32), np.asarray(trees, np.float32))

    def radiance(self, rays: Field, beam: float, drift: float) -> Field:
        """Return the radiance along rays that miss the ground.

        Parameters
        ----------
        rays
            ``(h, w, 3)`` world directions.
        beam
            Share of the direct sun that reaches the scene; the far land is as lit as we are.
        drift
            How far the clouds have moved, in their own heights.

        Returns
        -------
        ndarray
            ``(h, w, 3)`` float32.
        """
        level = np.sqrt(rays[..., 0] ** 2 + rays[..., 2] ** 2)
        climb = rays[..., 1] / level
        view = self._clear(rays, climb)
        cover, lit = self._clouds_along(rays, climb, drift)
        clouds = CLOUD_BASE + lit[..., None] * (CLOUD_TOP - CLOUD_BASE)
        view += cover[..., None] * (clouds - view)
        bright = np.float32(0.45 + 0.55 * beam)
        turn = np.arctan2(rays[..., 0], rays[..., 2]) / np.float32(2 * np.pi) * SKYLINE_COLUMNS
        for skyline, colour in ((self.hills, HILLS), (self.trees, TREES)):
            top = np.interp(turn + SKYLINE_COLUMNS / 2, np.arange(SKYLINE_COLUMNS), skyline)
            view += _below(climb, np.asarray(top, np.float32))[..., None] * (colour * bright - view)
        return view

    def _clear(self, rays: Field, climb: Field) -> Field:
        """Clear sky: pale at the horizon, bluer above, brighter near the sun."""
        height = np.clip(climb, 0.0, None)
        pale = np.exp(-4.2 * height)[..., None]
        unit = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        glow = 0.85 + 0.45 * np.clip(unit @ self.sun.towards.astype(np.float32), 0.0, 1.0) ** 2
        return np.asarray((ZENITH + pale * (HORIZON - ZENITH)) * glow[..., None], np.float32)

    def _clouds_along(self, rays: Field, climb: Field, drift: float) -> tuple[Field, Field]:
        """Cover 0..1 and brightness 0..1 of the clouds, which lie in a level plane."""
        height = np.maximum(rays[..., 1], 0.03)
        across = rays[..., 0] / height * np.float32(CLOUD_SCALE)
        along = (rays[..., 2] / height + np.float32(drift)) * np.float32(CLOUD_SCALE)
        density = cv2.remap(
            self.clouds, across, along, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP
        )
        cover = smoothstep(density, 0.35, 1.5) * smoothstep(climb, 0.03, 0.14)
        return np.asarray(cover, np.float32), smoothstep(-density, -3.0, -0.6)


def _below(climb: Field, top: Field) -> Field:
    """Opacity of a thing that rises to ``top``: 1 below, fading to 0 over `SKYLINE_SHARPNESS`."""
    return smoothstep(top - climb, -SKYLINE_SHARPNESS, SKYLINE_SHARPNESS)
