"""Samples of any depth, brought to eight bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def eight_bits(samples: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """Convert samples to 0..255: the upper half of 16 bits, floats from 0..1."""
    if samples.dtype.kind == "u" and samples.dtype.itemsize == 2:
        samples = samples >> 8
    elif samples.dtype == np.float32:
        samples = np.rint(np.clip(np.nan_to_num(samples), 0, 1) * 255)
    return np.asarray(samples, np.uint8)
