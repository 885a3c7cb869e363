"""From pixels to the numbers that a network takes."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb
from roadeval.networks.settings import NetSettings


def channel_count(settings: NetSettings) -> int:
    """Return how many channels the input has."""
    return 1 if settings.channels == "grey" else 3


def input_shape(settings: NetSettings) -> tuple[int, int, int, int]:
    """Return the shape of the input of stated settings."""
    assert settings.size is not None
    width, height = settings.size
    channels = channel_count(settings)
    if settings.layout == "NCHW":
        return 1, channels, height, width
    return 1, height, width, channels


def input_values(image: Rgb, settings: NetSettings, dtype: str) -> npt.NDArray[Any]:
    """Compute the input of an ``(h, w, 3)`` uint8 RGB image: ``(level scale - mean) / deviation``.

    Parameters
    ----------
    image
        Of the input's size.
    settings
        Stated ones.
    dtype
        Of the input. Whole numbers are rounded.
    """
    if settings.channels == "bgr":
        image = image[..., ::-1]
    elif settings.channels == "grey":
        image = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)[..., None]
    mean, deviation = (np.array(each, np.float64) for each in (settings.mean, settings.deviation))
    factor = (np.float64(settings.scale or 1) / deviation).astype(np.float32)
    values = image * factor - (mean / deviation).astype(np.float32)
    kind = np.dtype(dtype)
    if kind.kind in "iu":
        limits = np.iinfo(kind)
        values = np.clip(np.rint(values), limits.min, limits.max)
    planes = values.transpose(2, 0, 1) if settings.layout == "NCHW" else values
    return np.ascontiguousarray(planes[None], kind)
