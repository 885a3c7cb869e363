"""From a frame to a network's input, and from a map of the input back to the frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb
from roadeval.networks.settings import NetSettings

GREY: Final = 114
"""Grey level around an image that does not fill a letterbox."""

Plane = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Placement:
    """Where frames of one size lie in a network's input; sizes are width and height."""

    frame: tuple[int, int]
    """Size of the frame."""
    size: tuple[int, int]
    """Size of the input."""
    inner: tuple[int, int]
    """Size that the frame is brought to."""

    @property
    def corner(self) -> tuple[int, int]:
        """Row and column of the frame's first pixel in the input; negative where it is cut off."""
        (width, height), (inner_width, inner_height) = self.size, self.inner
        return (height - inner_height) // 2, (width - inner_width) // 2

    def image(self, image: Rgb) -> Rgb:
        """Return the input's pixels, ``(h, w, 3)`` uint8, of an ``(H, W, 3)`` uint8 frame."""
        small: Rgb = cv2.resize(image, self.inner, interpolation=cv2.INTER_LINEAR)
        if self.inner == self.size:
            return small
        whole = np.full((*self.size[::-1], 3), GREY, np.uint8)
        there, here = self._overlap()
        whole[there] = small[here]
        return whole

    def back(self, plane: Plane, *, exact: bool) -> Plane:
        """Bring an ``(h, w)`` map of the input, or a smaller one of all of it, to the frame's size.

        Interpolated linearly, or, where it is ``exact``, as labels are, by the nearest pixel. What
        the input did not show of the frame is 0.
        """
        how = cv2.INTER_NEAREST_EXACT if exact else cv2.INTER_LINEAR
        if self.inner != self.size:
            whole = cv2.resize(plane, self.size, interpolation=how)
            plane = np.zeros(self.inner[::-1], plane.dtype)
            there, here = self._overlap()
            plane[here] = whole[there]
        framed: Plane = cv2.resize(plane, self.frame, interpolation=how)
        return framed

    def _overlap(self) -> tuple[Any, Any]:
        """Return what the input and the resized frame have in common, as slices of each."""
        there, here = [], []
        for begin, whole, inner in zip(self.corner, self.size[::-1], self.inner[::-1], strict=True):
            first, last = max(0, begin), min(whole, begin + inner)
            there.append(slice(first, last))
            here.append(slice(first - begin, last - begin))
        return tuple(there), tuple(here)


@lru_cache(maxsize=16)
def placement(frame: tuple[int, int], size: tuple[int, int], resize: str) -> Placement:
    """Place frames of a width and height in an input of a size, see `NetSettings.resize`."""
    if resize == "stretch":
        return Placement(frame, size, size)
    ratios = [whole / side for whole, side in zip(size, frame, strict=True)]
    ratio = min(ratios) if resize == "letterbox" else max(ratios)
    width, height = (max(1, round(side * ratio)) for side in frame)
    return Placement(frame, size, (width, height))


def input_values(image: Rgb, settings: NetSettings, dtype: str) -> npt.NDArray[Any]:
    """Compute ``(level scale - mean) / deviation`` of an ``(h, w, 3)`` uint8 RGB image.

    The image has the input's size, the settings are stated; whole numbers are rounded.
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
