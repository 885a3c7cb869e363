"""Random fields, the material of textures; they do not depend on the place of the viewer."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import fft

Field = npt.NDArray[np.floating[Any]]
"""Any array of floats; each use states its shape."""
Reflectance = tuple[float, float, float]
"""Colour of a surface in red, green and blue, as shares of the light."""


def coloured_noise(
    rng: np.random.Generator, shape: tuple[int, int], finest: float, coarsest: float, slope: float
) -> Field:
    """Draw periodic Gaussian noise whose amplitude falls with frequency.

    Parameters
    ----------
    rng
        Source of randomness.
    shape
        Rows and columns. The field wraps around in both directions.
    finest, coarsest
        Shortest and longest wavelength that occur, in cells.
    slope
        Amplitude goes as frequency to the power ``-slope``: 0 is white, 1 looks like clouds.

    Returns
    -------
    ndarray
        ``shape`` float32, mean 0, standard deviation 1.
    """
    frequency = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None, :])
    passed = (frequency >= 1.0 / coarsest) & (frequency <= 1.0 / finest)
    gain = np.where(passed, np.maximum(frequency, 1.0 / coarsest) ** -slope, 0.0)
    white = rng.standard_normal(shape, dtype=np.float32)
    field = fft.irfft2(fft.rfft2(white) * gain.astype(np.float32), shape)
    return np.asarray(field / field.std(), np.float32)


def smoothstep(x: Field, low: float, high: float) -> Field:
    """Rise smoothly from 0 at ``low`` to 1 at ``high``."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t), np.float32)
