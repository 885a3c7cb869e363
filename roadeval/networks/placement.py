"""Where a frame lies in a network's input, and the way back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb

GREY: Final = 114
"""Grey level around an image that does not fill a letterbox."""

Plane = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Placement:
    """Where frames of one size lie in a network's input.

    Parameters
    ----------
    frame, size
        Width and height of the frame, and of the input.
    inner
        Width and height that the frame is brought to.
    left, top
        The place of its first pixel in the input; negative where it juts out.
    """

    frame: tuple[int, int]
    size: tuple[int, int]
    inner: tuple[int, int]
    left: int
    top: int

    def image(self, image: Rgb) -> Rgb:
        """Return the input's pixels, ``(h, w, 3)`` uint8, of an ``(H, W, 3)`` uint8 frame."""
        small: Rgb = cv2.resize(image, self.inner, interpolation=cv2.INTER_LINEAR)
        if self.inner == self.size:
            return small
        whole = np.full((self.size[1], self.size[0], 3), GREY, np.uint8)
        there, here = self._windows()
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
            plane = np.zeros((self.inner[1], self.inner[0]), plane.dtype)
            there, here = self._windows()
            plane[here] = whole[there]
        framed: Plane = cv2.resize(plane, self.frame, interpolation=how)
        return framed

    def _windows(self) -> tuple[Any, Any]:
        """Return what the input and the resized frame have in common, in each of them."""
        spans = [
            (max(0, begin), min(whole, begin + inner), begin)
            for begin, whole, inner in zip(
                (self.top, self.left), self.size[::-1], self.inner[::-1], strict=True
            )
        ]
        there = tuple(slice(first, last) for first, last, _ in spans)
        here = tuple(slice(first - begin, last - begin) for first, last, begin in spans)
        return there, here


@lru_cache(maxsize=16)
def placement(frame: tuple[int, int], size: tuple[int, int], resize: str) -> Placement:
    """Place frames of a width and height in an input of a size.

    Parameters
    ----------
    frame, size
        Width and height.
    resize
        ``stretch``, ``letterbox`` or ``crop``, see `roadeval.networks.settings.NetSettings`.
    """
    if resize == "stretch":
        return Placement(frame, size, size, 0, 0)
    ratios = [whole / side for whole, side in zip(size, frame, strict=True)]
    ratio = min(ratios) if resize == "letterbox" else max(ratios)
    width, height = (max(1, round(side * ratio)) for side in frame)
    return Placement(frame, size, (width, height), (size[0] - width) // 2, (size[1] - height) // 2)
