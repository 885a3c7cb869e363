"""Hue, saturation and value as the paper defines them (Eq. 3-5, section 3.2), both ways."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from roadeval.data.arrays import Floats


def value(rgb: npt.NDArray[np.uint8]) -> Floats:
    """Return V of ``(..., 3)`` uint8 RGB: ``(R + G + B) / 3`` over 255, in 0..1 (Eq. 3)."""
    result: Floats = rgb.sum(axis=-1, dtype=np.int64) / (3 * 255)
    return result


def saturation(rgb: npt.NDArray[np.uint8]) -> Floats:
    """Return S of ``(..., 3)`` uint8 RGB: ``1 - 3 min / (R + G + B)`` 0 for black (Eq. 4)."""
    total = rgb.sum(axis=-1, dtype=np.int64)
    low = rgb.min(axis=-1).astype(np.int64)
    return np.where(total > 0, 1.0 - 3.0 * low / np.maximum(total, 1), 0.0)


def hue(rgb: npt.NDArray[np.uint8]) -> Floats:
    """Return H of ``(..., 3)`` uint8 RGB in degrees, 0..360; 0 for greys (Eq. 5).

    The printed equation gives both branches the condition ``B <= G``; the second one is
    ``360 - theta`` where ``B > G``.
    """
    r, g, b = (rgb[..., c].astype(np.float64) for c in range(3))
    root = np.sqrt((r - g) ** 2 + (r - b) * (g - b))
    cosine = 0.5 * ((r - g) + (r - b)) / np.where(root > 0, root, 1.0)
    theta = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return np.where(root > 0, np.where(b <= g, theta, 360.0 - theta), 0.0)


def to_rgb(h: Floats, s: Floats, v: Floats) -> npt.NDArray[np.uint8]:
    """Invert Eq. 3-5: ``(...,)`` degrees, 0..1, 0..1 to ``(..., 3)`` uint8 RGB, clipped.

    Within each third of the hue circle the least channel is ``V (1 - S)``, the leading one
    follows from the hue, and the last one from ``R + G + B = 3 V``.
    """
    third = np.floor(np.mod(h, 360.0) / 120.0).astype(np.int64) % 3
    angle = np.radians(np.mod(h, 120.0))
    least = v * (1.0 - s)
    leading = v * (1.0 + s * np.cos(angle) / np.cos(np.pi / 3.0 - angle))
    between = 3.0 * v - least - leading
    rgb = np.empty((*np.shape(h), 3))
    # Third 0 runs from red to green, 1 from green to blue, 2 from blue to red.
    for channel in range(3):
        place = (channel - third) % 3
        rgb[..., channel] = np.select([place == 0, place == 1], [leading, between], least)
    return np.clip(np.rint(rgb * 255.0), 0, 255).astype(np.uint8)
