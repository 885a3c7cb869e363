"""The light that a frame was taken in, measured from its image alone.

It asks whether a method fails at dusk, in the sun or among shadows, on drives that nobody has
tagged. The measures of one frame depend on what is in it; a drive's means show the light.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb

Values = npt.NDArray[np.float32]

WIDTH: Final = 80
"""Pixels across the image that is measured: areas count, not texture or noise."""
BRIGHT: Final = 0.85
"""So much of the lower half is darker than what counts as lit."""
DARK: Final = 0.5
"""A pixel of less than this share of that brightness is in shadow, or dark by itself."""
GREY: Final = 0.25
"""The greatest ``|2 ln G - ln R - ln B|`` of what may be road: leaves and paint say more about
themselves than about the light."""
LEAST: Final = 20
"""Fewer grey pixels, dark or lit, do not show the colour of the light."""
_LUMA: Final = np.array([0.299, 0.587, 0.114], np.float32)
"""Of R, G and B, as in ITU-R BT.601, which JPEG uses."""


@dataclass(frozen=True, slots=True)
class Light:
    """The light of a frame."""

    luminance: float
    contrast: float
    """Mean and standard deviation of the image's brightness, from 0 to 1."""
    shadow: float
    """The share of the lower half that is darker than `DARK` times its brightness at the quantile
    `BRIGHT`.
    """
    sun: float
    """How much bluer the dark grey pixels of the lower half are than the lit grey ones: the
    difference of the medians of ``ln B - ln R``. In the sun a shadow is lit by the blue sky alone;
    under clouds all light has one colour, and it is about 0 or less. NaN where too few pixels are
    dark, or lit, and grey.
    """


def light_of(image: Rgb) -> Light:
    """Measure the light of an ``(H, W, 3)`` uint8 RGB image."""
    small = _reduced(image)
    luma = small @ _LUMA
    below, bright = small[len(small) // 2 :].reshape(-1, 3), luma[len(luma) // 2 :].ravel()
    place = int(BRIGHT * (bright.size - 1))
    dark = bright < DARK * np.partition(bright, place)[place]
    return Light(
        luminance=float(luma.mean()) / 255,
        contrast=float(luma.std()) / 255,
        shadow=float(dark.mean()),
        sun=_bluer(below, dark),
    )


def _reduced(image: Rgb) -> Values:
    """Return the image at `WIDTH` pixels across, or as it is where it is smaller; float32."""
    import cv2

    height, width = image.shape[:2]
    if width > WIDTH:
        size = WIDTH, max(round(height * WIDTH / width), 2)
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return image.astype(np.float32)


def _bluer(colours: Values, dark: npt.NDArray[np.bool_]) -> float:
    # Eight grey levels more keep dark, noisy pixels from running away, as in `road_light`.
    red, green, blue = np.log(colours.T + 8)
    grey = np.abs(2 * green - red - blue) < GREY
    shaded, lit = ((blue - red)[grey & chosen] for chosen in (dark, ~dark))
    if min(len(shaded), len(lit)) < LEAST:
        return float("nan")
    return float(np.median(shaded) - np.median(lit))
