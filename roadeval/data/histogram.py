"""Histograms of pixels by their probability of road, and the threshold with the fewest errors."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data.frame import NON_ROAD, ROAD, Histogram, Probability, Truth

CODES: Final = 1 << 16
"""Codes of a probability."""
CERTAIN: Final = CODES - 1
"""The code of a probability of 1; code 0 is a probability of 0."""


def histogram(probability: Probability, truth: Truth) -> Histogram:
    """Count the labelled pixels by code: ``(2, 65536)`` uint32, non-road and road.

    ``probability`` is ``(H, W)`` uint16 codes, ``truth`` ``(H, W)`` uint8: 0 non-road, 1 road, 255
    ignored.
    """
    counts = [np.bincount(probability[truth == side], minlength=CODES) for side in (NON_ROAD, ROAD)]
    return np.array(counts, np.uint32)


def wrong_above(counts: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Return for each code, as threshold, the number of wrong pixels, ``(65536,)`` int64.

    Pixels above the threshold are called road. ``counts`` are ``(2, 65536)``: non-road and road.
    """
    other, road = counts.astype(np.int64).cumsum(axis=1)
    wrong: npt.NDArray[np.int64] = other[-1] - other + road
    return wrong


def best_code(counts: npt.NDArray[Any]) -> int:
    """Return the threshold of `wrong_above` with the fewest errors; the middle one of equals."""
    wrong = wrong_above(counts)
    first = int(wrong.argmin())
    beyond = np.flatnonzero(wrong[first:] != wrong[first])
    return first + (int(beyond[0]) - 1 if len(beyond) else CERTAIN - first) // 2
