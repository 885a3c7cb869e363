"""Training frames shown once more, with something on the ground in front of the vehicle.

Features are measured against the reference patch, which is bare road in nearly every training
frame. What learns from those alone is helpless where paint, a shadow or the vehicle ahead covers
the patch. So some frames are shown twice, the second time with the ground there tinted, or with a
piece of another training frame pasted on it [1]_.

References
----------
.. [1] D. Dwibedi, I. Misra, M. Hebert, Cut, Paste and Learn: Surprisingly Easy Synthesis for
   Instance Detection, ICCV (2017).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import cv2
import numpy as np

from roadeval.data import IGNORE, NON_ROAD, ROAD, Rgb, Truth
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask

OBSTACLES: Final = 0.2
"""Of the covered frames; on the others the ground has another colour."""
TRIES: Final = 20
"""To find a piece of a frame that shows no road."""
PURE: Final = 0.95
"""Least share of non-road of such a piece."""
TINT, SHADE, DARKNESS = 0.25, 0.4, -0.2
"""Deviations of the logarithm of a colour's gains, and of that of brightness; its mean where
something stands there: what is seen from behind lies in its own shade."""


class Shown(NamedTuple):
    """A training frame: ``(H, W, 3)`` uint8 RGB, and its truth, ``(H, W)`` uint8 (0, 1, 255)."""

    image: Rgb
    truth: Truth


def covered(
    frames: Sequence[Shown], share: float, patch: ReferencePatch, seed: int
) -> Iterator[Shown]:
    """Yield a share of the frames, drawn by the seed, with the patch covered.

    Parameters
    ----------
    frames
        The training frames.
    share
        Of them; rounded to a whole number of frames.
    patch
        What is to be covered.
    seed
        Of the draw.
    """
    rng = np.random.default_rng(seed)
    drawn = rng.permutation(len(frames))[: round(share * len(frames))]
    for place, index in enumerate(drawn):
        if place < OBSTACLES * len(drawn):
            yield obstructed(frames[index], frames, patch, rng)
        else:
            yield tinted(frames[index], patch, rng)


def tinted(frame: Shown, patch: ReferencePatch, rng: np.random.Generator) -> Shown:
    """Return a frame whose road has another colour and brightness in front of the vehicle.

    As under paint, a shadow or water: the texture stays. The place is a trapezoid like the patch,
    up to some three times as wide, moved sideways by up to a tenth of the width.
    """
    height, width = frame.truth.shape
    place = ReferencePatch(
        top=patch.top * rng.uniform(2 / 3, 1.03),
        bottom=1.0 if rng.random() < 0.5 else min(1.0, patch.bottom * rng.uniform(0.98, 1.05)),
        top_width=min(1.0, patch.top_width * rng.uniform(0.75, 3)),
        bottom_width=min(1.0, patch.bottom_width * rng.uniform(1, 2.5)),
    )
    aside = round(width * rng.uniform(-0.1, 0.1))
    inside = np.roll(patch_mask(height, width, place), aside, axis=1) > 0
    gains = np.exp(rng.normal(0, TINT, 3) + rng.normal(0, SHADE))
    levels = np.clip(np.rint(np.arange(256)[:, None] * gains), 0, 255).astype(np.uint8)
    image = frame.image.copy()
    changed = inside & (frame.truth == ROAD)
    image[changed] = cv2.LUT(frame.image, levels[None])[changed]
    return Shown(image, frame.truth)


def obstructed(
    frame: Shown, frames: Sequence[Shown], patch: ReferencePatch, rng: np.random.Generator
) -> Shown:
    """Return a frame with a piece of non-road of some frame in front of the vehicle.

    It is a quarter to three fifths of the width wide, reaches down over some of the patch at least,
    and is non-road now. Where `TRIES` draws find no such piece the frame stays as it is.
    """
    height, width = frame.truth.shape
    piece = _piece(frames, rng)
    if piece is None:
        return frame
    across = round(width * rng.uniform(0.25, 0.6))
    top = round(height * rng.uniform(0.4, 0.85) * patch.top)
    bottom = round(height * rng.uniform(min(1, patch.top + 0.03), 1))
    left = round((width - across) / 2 + width * rng.uniform(-0.12, 0.12))
    place = np.s_[top : max(bottom, top + 1), max(left, 0) : max(left, 0) + max(across, 1)]
    image, truth = frame.image.copy(), frame.truth.copy()
    rows, columns = truth[place].shape
    pasted = cv2.resize(piece, (columns, rows)) * np.exp(rng.normal(DARKNESS, SHADE))
    image[place] = np.clip(np.rint(pasted), 0, 255)
    truth[place] = np.where(truth[place] == IGNORE, IGNORE, NON_ROAD)
    return Shown(image, truth)


def _piece(frames: Sequence[Shown], rng: np.random.Generator) -> Rgb | None:
    """Draw a piece of a frame that shows no road, of a tenth to two fifths of its sides."""
    for _ in range(TRIES):
        image, truth = frames[int(rng.integers(len(frames)))]
        height, width = truth.shape
        rows = max(1, round(height * rng.uniform(0.1, 0.35)))
        columns = max(1, round(width * rng.uniform(0.1, 0.4)))
        top = int(rng.integers(0, max(1, round(0.9 * height) - rows)))
        left = int(rng.integers(0, width - columns + 1))
        place = np.s_[top : top + rows, left : left + columns]
        if (truth[place] == NON_ROAD).mean() >= PURE:
            return image[place]
    return None
