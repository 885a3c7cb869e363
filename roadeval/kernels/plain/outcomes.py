"""Outcomes of a mask: pixel by pixel, and in how many frames."""

from __future__ import annotations

import numpy as np

from roadeval.data.arrays import FN, FP, IGNORED, Image, Plane


def outcomes(mask: Plane, truth: Plane) -> Plane:
    """Classify each pixel of a mask, ``(H, W)`` of 0 and 1, by a truth of 0, 1 and 255 for ignored.

    Returns
    -------
    numpy.ndarray
        ``(H, W)`` uint8: `TN`, `TP`, `FP`, `FN` or `IGNORED`.
    """
    # TN 0 and TP 1 where the two agree, FP 2 and FN 3 where not; beyond 4 what is ignored.
    return np.minimum(truth + 2 * (truth ^ mask), np.uint8(IGNORED))


def add_outcomes(errors: Plane, totals: Image) -> None:
    """Add to ``(3, H, W)`` uint8 ``totals``, in place, where `outcomes` are labelled, FP and FN."""
    counted = errors != IGNORED, errors == FP, errors == FN
    for total, found in zip(totals, counted, strict=True):
        np.add(total, found, out=total)
