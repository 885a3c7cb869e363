"""The role of each frame of a run: training, copy of a training frame, gap, evaluated, unlabelled.

Training pictures occur again re-encoded, or as neighbours in the same journey. A frame's hash
identifies the file that was logged, which re-encoding changes. A fingerprint is the picture's
brightness on a coarse grid: its correlation with another one is close to 1 where both show the
same, whatever the encoding and the size.

How far apart two fingerprints are, as the root mean square of their difference, was measured on
seven sets of real frames and three synthetic drives:

=================================================  =====================
the same frame                                     at most
=================================================  =====================
as PNG, or with bytes appended                     0
as JPEG of quality 95, 75, 50                      0.006, 0.010, 0.015
with video's reduced range of brightness           0.017
as WebP of quality 50, as JPEG of quality 30       0.022, 0.027
half the size by averaging, from even sizes        0.016
other sizes, or without averaging (median 0.03)    0.08
=================================================  =====================

(Images below some 200 pixels of width are moved further by JPEG.)

=================================================  =====================
the next frame                                     at least
=================================================  =====================
a motorway, 25 Hz                                  0.041
a street, 15 Hz                                    0.066
=================================================  =====================

On the coarse grid the nearest frame of the same journey at 1 Hz is 0.04 to 0.28 away (median 0.12),
and none of another journey nearer than 0.33. Pictures of a static camera and scene differ only by
noise, less than by another encoding: they count as the same picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Frame, Rgb, Role
from roadeval.logs import Picks, Why

SIDE: Final = 32
"""Cells of the grid along each edge of the image."""
COARSE: Final = 8
"""Those of the coarse grid, made of the other."""
SAME: Final = 0.02
"""Largest distance of fingerprints of one picture."""
BESIDE: Final = 0.2
"""Largest distance of coarse fingerprints of one place, seen from nearly the same point."""
FLAT: Final = 1e-3
"""A grid of a smaller deviation has too little contrast to be compared."""

Fingerprint = npt.NDArray[np.float16]
"""``(SIDE * SIDE,)``, of mean 0 and deviation 1; all 0 where the picture has one brightness."""
Grids = npt.NDArray[np.float32]


def fingerprint(image: Rgb) -> Fingerprint:
    """Return the fingerprint of an ``(H, W, 3)`` uint8 RGB image."""
    import cv2

    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    grid = cv2.resize(grey, (SIDE, SIDE), interpolation=cv2.INTER_AREA)
    return _standardised(grid.reshape(-1)).astype(np.float16)


class Likeness:
    """The pictures of training frames, to compare others with.

    The fingerprints are ``(n, SIDE * SIDE)`` float16.
    """

    def __init__(self, fingerprints: npt.NDArray[np.float16]) -> None:
        self._fine = _standardised(fingerprints)
        self._coarse = _coarser(self._fine)

    def of(self, image: Rgb) -> tuple[bool, frozenset[int]]:
        """Compare an ``(H, W, 3)`` uint8 RGB image with the training frames; from any thread.

        Returned are whether one of them shows the same, and the indices of those beside it.
        """
        fine = _standardised(fingerprint(image))
        beside = np.flatnonzero(_near(self._coarse, _coarser(fine), BESIDE))
        return bool(_near(self._fine, fine, SAME).any()), frozenset(beside.tolist())


def _near(known: Grids, seen: Grids, limit: float) -> npt.NDArray[np.bool_]:
    """Whether each of ``(n, k)`` grids is within a distance of one of ``(k,)``; of 0s none is.

    With r the correlation of two grids of deviation 1, their squared distance is ``2 - 2 r``.
    """
    correlation = known @ seen / len(seen)
    near: npt.NDArray[np.bool_] = 2 - 2 * correlation <= limit**2
    return near


def _coarser(grids: Grids) -> Grids:
    """Average the cells of ``(..., SIDE * SIDE)`` grids to coarse ones."""
    block = SIDE // COARSE
    cells = grids.reshape(*grids.shape[:-1], COARSE, block, COARSE, block).mean(axis=(-3, -1))
    return _standardised(cells.reshape(*grids.shape[:-1], -1))


def _standardised(grids: npt.NDArray[np.floating]) -> Grids:
    """Bring each of ``(..., k)`` grids to mean 0 and deviation 1; one of a single value to 0."""
    exact = grids.astype(np.float32)
    exact -= exact.mean(axis=-1, keepdims=True)
    deviation = np.sqrt((exact**2).mean(axis=-1, keepdims=True))
    result: Grids = np.divide(exact, deviation, out=np.zeros_like(exact), where=deviation > FLAT)
    return result


@dataclass(frozen=True, slots=True)
class Use:
    """What a frame is used for, and which training frames of a model file show its place."""

    role: Role
    beside: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True)
class Schedule:
    """What each frame of a run is used for."""

    digests: frozenset[str]
    """Hashes of the frames that trained the model."""
    gap: frozenset[int] = frozenset()
    """Numbers of the frames after them that are left out as well."""
    first: int | None = None
    """Number of the first frame to evaluate, where it is known beforehand."""
    sizes: frozenset[int] | None = None
    """Sizes in bytes of the training frames as logged, if known: frames of other sizes are not
    hashed."""
    likeness: Likeness | None = None
    """The pictures of the training frames of a model file: frames that show the same are not
    evaluated. In a log that trains its own model later frames count as others, however similar."""
    picks: Picks | None = None
    """Which frames were picked to be labelled: those that were drawn at random are evaluated."""

    def use(self, frame: Frame) -> Use:
        """Return what a decoded frame is used for."""
        same, beside = False, frozenset[int]()
        if self.likeness is not None:
            same, beside = self.likeness.of(frame.image)
        role = Role.UNLABELLED if frame.truth is None else Role.EVALUATED
        if self.picks is not None and frame.truth is not None:
            if self.picks.is_proposal(frame.stamp_ns, frame.truth):
                role = Role.UNLABELLED
            elif frame.stamp_ns not in self.picks.stamps_of(Why.RANDOM):
                role = Role.PICKED
        if frame.number in self.gap:
            role = Role.GAP
        if same:
            role = Role.COPY
        if self.sizes is None or len(frame.payload) in self.sizes:
            role = Role.TRAINING if frame.digest() in self.digests else role
        return Use(role, beside)
