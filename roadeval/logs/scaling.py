"""Frames at a reduced scale, and labels brought to the size of their image."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from roadeval.data import Frame

Pixels = TypeVar("Pixels", npt.NDArray[np.uint8], npt.NDArray[np.uint16])


def scaled_size(size: tuple[int, int], scale: float) -> tuple[int, int]:
    """Scale a width and height, to whole pixels."""
    width, height = (max(1, round(length * scale)) for length in size)
    return width, height


def at_scale(frame: Frame, scale: float) -> Frame:
    """Reduce a frame to a share of its width and height, at most 1.

    Colours are averaged over the area of each new pixel; labels are the nearest pixel's. The
    payload stays the logged file, by which a frame is recognised, but no longer this image's.
    """
    if scale == 1:
        return frame
    import cv2

    size = scaled_size((frame.image.shape[1], frame.image.shape[0]), scale)
    return replace(
        frame,
        image=cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA),
        media_type=None,
        truth=None if frame.truth is None else nearest(frame.truth, size),
        shadow_truth=None if frame.shadow_truth is None else nearest(frame.shadow_truth, size),
        external={name: nearest(mask, size) for name, mask in frame.external.items()},
        probabilities={name: nearest(each, size) for name, each in frame.probabilities.items()},
    )


def nearest(labels: Pixels, size: tuple[int, int]) -> Pixels:
    """Resize labels, or probabilities, to a width and height, by the nearest pixel."""
    import cv2

    how = cv2.INTER_NEAREST_EXACT
    return np.asarray(cv2.resize(labels, size, interpolation=how), labels.dtype)
