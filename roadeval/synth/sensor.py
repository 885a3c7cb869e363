"""The camera as an instrument: lens, exposure, noise, response."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from roadeval.data import Rgb
from roadeval.synth.light import SKY, SUN
from roadeval.synth.noise import Field

WHITE_BALANCE: Final = (SUN + SKY)[1] / (SUN + SKY)
"""Gains that make a grey card grey in full daylight; shadows stay bluish."""
MIDDLE: Final = 0.115
"""Where the automatic exposure wants the (geometric) mean, as a share of saturation."""
REACTION: Final = 0.5
"""Time constant of the automatic exposure, seconds."""
FULL_WELL: Final = 9000.0
"""Electrons at saturation: the shot noise at level x is ``sqrt(x / FULL_WELL)``."""
READ_NOISE: Final = 9.0
"""Electrons."""
BLUR: Final = 0.6
"""Standard deviation of the lens' blur at 640 columns, pixels."""
VIGNETTING: Final = 0.22
"""Share of the light that is lost in the corners of the image."""
CONTRAST: Final = 0.75
"""How much of an S curve the response has on top of the power law."""
CODES: Final = 4096
"""Levels of the converter before the response."""


def response() -> Field:
    """``(CODES,)`` float32: the code 0..255 of each linear level 0..1.

    A power law with an S curve and a soft shoulder, as small cameras have.
    """
    linear = np.linspace(0.0, 1.0, CODES)
    shoulder = 1.0 - np.exp(-1.9 * linear)
    tone = (shoulder / shoulder[-1]) ** (1 / 2.2)
    steep = tone * tone * (3 - 2 * tone)
    return np.asarray(255 * (tone + CONTRAST * (steep - tone)), np.float32)


@dataclass(slots=True)
class Sensor:
    """Turns radiance into an image; the exposure follows the scene with some delay.

    Parameters
    ----------
    width, height
        Pixels.
    interval
        Seconds between images.
    """

    width: int
    height: int
    interval: float
    exposure: float | None = None

    def expose(self, radiance: Field, rng: np.random.Generator) -> Rgb:
        """Take the picture of ``(H, W, 3)`` float32 radiance."""
        optical = cv2.GaussianBlur(radiance, (0, 0), BLUR * self.width / 640)
        optical *= (self._vignette() * np.float32(self._metered(radiance)))[..., None]
        electrons = np.minimum(optical * WHITE_BALANCE.astype(np.float32), 1.0)
        noise = rng.standard_normal(electrons.shape, dtype=np.float32)
        noise *= np.sqrt(
            electrons / np.float32(FULL_WELL) + np.float32((READ_NOISE / FULL_WELL) ** 2)
        )
        levels = np.clip((electrons + noise) * (CODES - 1) + 0.5, 0, CODES - 1).astype(np.uint16)
        return np.rint(response()).astype(np.uint8)[levels]

    def _metered(self, radiance: Field) -> float:
        """Move the exposure towards what the lower two thirds of the scene ask for."""
        metered = radiance[self.height // 3 :: 4, ::4, 1]
        wanted = MIDDLE / float(np.exp(np.log(metered + 1e-3).mean()))
        if self.exposure is None:
            self.exposure = wanted
        share = 1.0 - np.exp(-self.interval / REACTION)
        self.exposure *= (wanted / self.exposure) ** share
        return self.exposure

    def _vignette(self) -> Field:
        """``(H, W)`` share of the light that arrives, 1 in the middle."""
        y = np.linspace(-1, 1, self.height, dtype=np.float32)[:, None]
        x = np.linspace(-1, 1, self.width, dtype=np.float32)[None, :]
        return np.asarray(1 - np.float32(VIGNETTING / 2) * (x * x + y * y))
