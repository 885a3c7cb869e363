"""Regions: sets of pixels that are counted separately in every labelled frame."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import lru_cache
from math import isqrt
from typing import NamedTuple

import numpy as np

from roadeval.data import Frame, TruthBits, VariantResult
from roadeval.data.arrays import Bits, Reach
from roadeval.evaluation.metres import Survey
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.kernels import KERNELS


class LabelledFrame(NamedTuple):
    """The input of a region: a frame, its packed truth, and the variants' results."""

    frame: Frame
    truth: TruthBits
    variants: tuple[VariantResult, ...]
    settings: EvaluationSettings
    survey: Survey | None = None
    """The places of its pixels on the ground; None if the camera is not known."""


class Region(NamedTuple):
    """A region, or several that are computed together."""

    titles: Mapping[str, str] | Callable[[Collection[str], int], Mapping[str, str]]
    """Titles for people, in order, by name; the column ``region`` of the tables holds the names.

    If titles depend on the drive, this is a function. It takes names and the height of the images
    in pixels, 0 if unknown, and returns the titles of these names.
    """
    order: int
    """Position in tables and reports, the lowest first; equal ones are sorted by file."""
    find: Callable[[LabelledFrame], Mapping[str, Bits]]
    """Computes the regions that a frame has, ``(H, words)`` each, by name."""

    def titles_of(self, names: Collection[str], height: int = 0) -> Mapping[str, str]:
        """Return titles by name, in order, without the names that are not of this region."""
        if callable(self.titles):
            return self.titles(names, height)
        return {name: title for name, title in self.titles.items() if name in names}


def grow(bits: Bits, reach: Reach, truth: TruthBits) -> Bits:
    """Return a mask, ``(H, words)``, dilated by a structuring element."""
    grown: Bits = KERNELS.dilate(bits, reach, truth.shape[1])
    return grown


@lru_cache(maxsize=8)
def square(radius: int) -> Reach:
    """Return the square of ``radius`` pixels in chessboard distance, ``(radius + 1,)`` int64."""
    return np.full(radius + 1, radius)


@lru_cache(maxsize=8)
def disk(radius: int) -> Reach:
    """Return the disk of ``radius`` pixels in Euclidean distance, ``(radius + 1,)`` int64."""
    return np.array([isqrt(radius**2 - row**2) for row in range(radius + 1)])
