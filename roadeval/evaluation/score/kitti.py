"""KITTI's road benchmark: masks in bird's-eye view, by the rule of its development kit.

Cells of 5 cm lie from 6 to 46 m ahead and 10 m to either side. Each cell has the same pixel as in
the kit, which counts pixels from 1. Cells outside the picture, or outside the evaluated area, are
in no count; the frames of a category are counted together. See `metre_sums.kitti`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import CERTAIN, NON_ROAD, ROAD, Frame, Histogram, Packed, Probability
from roadeval.evaluation.metres import LEVELS
from roadeval.evaluation.score.counts import Name
from roadeval.evaluation.score.metre_sums import kitti
from roadeval.evaluation.score.thresholds import Curves
from roadeval.geometry.ground import Ground, ground_under

CATEGORIES: Final = {"um": "UM", "umm": "UMM", "uu": "UU"}
"""Categories by the beginning of an image's name; URBAN is all of them together."""


def count_levels(
    frame: Frame, masks: Mapping[Name, Packed], probabilities: Mapping[Name, Probability]
) -> dict[Name, Histogram]:
    """Count the cells of a frame by threshold: ``(2, 256)`` uint32, non-road and road.

    Keys are variant and category; the result is empty for an image without a category. A mask
    without probabilities has two thresholds.
    """
    category, lens = CATEGORIES.get(frame.name.partition("_")[0]), frame.calibration
    if frame.truth is None or category is None or lens is None or lens.mounting is None:
        return {}
    height, width = frame.truth.shape
    pixels = pixels_above(ground_under(lens, lens.mounting).scaled(width, height))
    labels, counts = frame.truth.ravel()[pixels], {}
    probable = {variant: codes for (variant, _), codes in probabilities.items()}
    for variant, mask in {variant: mask for (variant, _), mask in masks.items()}.items():
        codes = probable.get(variant)
        codes = mask.pixels() * np.uint16(CERTAIN) if codes is None else codes
        levels = codes.ravel()[pixels] // (CERTAIN // (LEVELS - 1))
        sides = [np.bincount(levels[labels == side], minlength=LEVELS) for side in (NON_ROAD, ROAD)]
        counts[variant, category] = np.array(sides, np.uint32)
    return counts


def pixels_above(ground: Ground) -> npt.NDArray[np.intp]:
    """Return the pixels of the cells inside the picture, as indices of a flat image."""
    ahead, left = np.meshgrid(np.arange(6.025, 46, 0.05), np.arange(-9.975, 10, 0.05))
    seen = ground.pixels(np.column_stack([ahead.ravel(), left.ravel()]))
    inside = np.all((seen >= 1) & (seen <= (ground.width, ground.height)), axis=1)
    columns, rows = seen[inside].astype(np.intp).T - 1
    return np.asarray(rows * ground.width + columns, np.intp)


def benchmark(curves: Curves) -> dict[str, dict[str, dict[str, Any]]]:
    """Return the number of ``frames`` and the rates by variant and category."""
    rates: dict[str, dict[str, dict[str, Any]]] = {}
    for name in dict.fromkeys(variant for variant, _ in curves.counts):
        for title in (*CATEGORIES.values(), "URBAN"):
            keys = [key for key in curves.counts if key[0] == name and title in (key[1], "URBAN")]
            if keys:
                levels = np.sum([curves.counts[key] for key in keys], axis=0)
                frames = sum(curves.frames[key] for key in keys)
                table = {"frames": frames, **kitti(np.zeros(4, np.int64), levels)}
                rates.setdefault(name, {})[title] = table
    return rates
