"""The camera as an instrument: lens, exposure, noise, response."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from benchmarks.world.light import SKY, SUN
from benchmarks.world.noise import Field
from roadeval.data import Rgb

WHITE_BALANCE: Final = (SUN + SKY)[1] / (SUN + SKY)
"""Gains that make a grey card grey in full daylight; shadows stay bluish."""
MIDDLE: Final = 0.115
"""Where the automatic exposure wants the geometric mean, as a share of saturation."""
REACTION: Final = 0.5
"""Time constant of the automatic exposure, seconds."""
FULL_WELL: Final = 9000.0
"""Electrons at saturation: the shot noise at level x is ``sqrt(x / FULL_WELL)``."""
READ_NOISE: Final = 9.0
"""Electrons."""
BLUR: Final = 0.6
"""Standard deviation of the lens' blur in an image of 640 columns, pixels."""
VIGNETTING: Final = 0.22
"""Share of the light that is lost in the corners of the image."""
SHOULDER: Final = 1.9
"""How softly the response runs into saturation."""
CONTRAST: Final = 0.75
"""How much of an S curve the response has on top of the power law."""
LEVELS: Final = 4096
"""Levels of the converter before the response."""


def response() -> Rgb:
    """``(LEVELS,)`` uint8: the code of each linear level from 0 to 1.

    A power law with an S curve and a soft shoulder, as small cameras have.
    """
    linear = np.linspace(0.0, 1.0, LEVELS)
    tone = ((1 - np.exp(-SHOULDER * linear)) / (1 - np.exp(-SHOULDER))) ** (1 / 2.2)
    steep = tone * tone * (3 - 2 * tone)
    return np.asarray(np.rint(255 * (tone + CONTRAST * (steep - tone))), np.uint8)


class Sensor:
    """Turns radiance into images of one size; the exposure follows the scene with some delay.

    Parameters
    ----------
    width, height
        Pixels.
    interval
        Seconds between images.
    """

    def __init__(self, width: int, height: int, interval: float) -> None:
        self._blur = BLUR * width / 640
        self._pace = float(1 - np.exp(-interval / REACTION))
        self._exposure: float | None = None
        self._response = response()
        y = np.linspace(-1, 1, height, dtype=np.float32)[:, None]
        x = np.linspace(-1, 1, width, dtype=np.float32)[None, :]
        self._vignette = 1 - np.float32(VIGNETTING / 2) * (x * x + y * y)

    def expose(self, radiance: Field, rng: np.random.Generator) -> Rgb:
        """Take the picture, ``(H, W, 3)`` uint8, of ``(H, W, 3)`` float32 radiance."""
        level = cv2.GaussianBlur(radiance, (0, 0), self._blur)
        level *= (self._vignette * np.float32(self._metered(radiance)))[..., None]
        level *= WHITE_BALANCE
        noise = rng.standard_normal(level.shape, dtype=np.float32)
        noise *= np.sqrt(level / np.float32(FULL_WELL) + np.float32((READ_NOISE / FULL_WELL) ** 2))
        level += noise
        codes = np.clip(level * (LEVELS - 1) + 0.5, 0, LEVELS - 1).astype(np.uint16)
        return np.asarray(self._response[codes])

    def _metered(self, radiance: Field) -> float:
        """Move the exposure towards that of the lower two thirds of the scene."""
        metered = radiance[len(radiance) // 3 :: 4, ::4, 1]
        exposure = MIDDLE / float(np.exp(np.log(metered + 1e-3).mean()))
        if self._exposure is None:
            self._exposure = exposure
        self._exposure *= (exposure / self._exposure) ** self._pace
        return self._exposure
