"""The meaning of the values, or of the colours, of label images."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, Truth
from roadeval.images import Limits
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pictures import Picture
from roadeval.logs.messages.pixels import lossy_format, to_labels, to_rgb

UNKNOWN: Final = 254
"""Marks a value whose meaning is not known."""
FRINGE: Final = 253
"""Marks a value that lies too far from every known one, as compression makes them at edges."""


@dataclass(frozen=True, eq=False)
class LabelMap:
    """The meaning of the values, or of the colours, of a topic's label images.

    Parameters
    ----------
    meaning
        Truth by label value, or by packed colour (`pack_colors`).
    others
        Truth of any other value; with `UNKNOWN` such a value is an error where it occurs, with
        `FRINGE` it is ignored and counted.
    tolerance
        How far a value may lie from one in ``meaning`` to mean the same.
    by_color
        Whether colours are looked up instead of values.
    words
        The meaning in words.
    """

    meaning: Mapping[int, int]
    others: int
    by_color: bool
    words: str
    tolerance: int = 0

    @property
    def by_itself(self) -> bool:
        """Whether a mask was understood without settings."""
        return self.others == UNKNOWN

    @cached_property
    def _table(self) -> npt.NDArray[np.uint8]:
        """``(65536,)`` truth by label value."""
        table = np.full(65536, self.others, np.uint8)
        for value, truth in self.meaning.items():
            table[max(value - self.tolerance, 0) : value + self.tolerance + 1] = truth
        return table

    def read(self, picture: Picture, limits: Limits) -> tuple[Truth, int]:
        """Decode a label picture.

        Returns
        -------
        (H, W) uint8, int
            The truth, and how many of its pixels are ignored because they are fringes.

        Raises
        ------
        BadMessage
            If it cannot be decoded, or holds an unknown value, or colours instead of values; or
            is compressed in a way that changes values, without a tolerance for that.
        """
        if self.others != FRINGE and (name := lossy_format(picture)):
            raise BadMessage(f"a {name}, whose compression changes label values")
        if self.by_color:
            return self._of_colors(pack_colors(to_rgb(picture, limits))), 0
        labels = to_labels(picture, limits)
        if labels.ndim != 2:
            raise BadMessage("it holds colours, not label values")
        truth = self.of_values(labels)
        if self.others != FRINGE:
            return truth, 0
        fringe = truth == FRINGE
        truth[fringe] = IGNORE
        return truth, int(np.count_nonzero(fringe))

    def of_values(self, labels: npt.NDArray[Any]) -> Truth:
        """Translate ``(H, W)`` uint8 or uint16 labels.

        Raises
        ------
        BadMessage
            If a value is unknown.
        """
        if labels.dtype == np.uint8:
            import cv2

            truth: Truth = cv2.LUT(np.ascontiguousarray(labels), self._table[:256])
        else:
            truth = self._table[labels]
        if self.by_itself and (truth == UNKNOWN).any():
            value = int(labels[truth == UNKNOWN][0])
            raise BadMessage(f"it holds the value {value}, unlike the frames before ({self.words})")
        return truth

    def _of_colors(self, labels: npt.NDArray[np.uint32]) -> Truth:
        truth = np.full(labels.shape, self.others, np.uint8)
        for color, meaning in self.meaning.items():
            truth[labels == color] = meaning
        return truth


def pack_colors(colors: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint32]:
    """``(H, W)`` numbers for ``(H, W, 3)`` colours: red * 65536 + green * 256 + blue."""
    wide = colors.astype(np.uint32)
    return np.asarray(wide[..., 0] << 16 | wide[..., 1] << 8 | wide[..., 2], np.uint32)


def color_name(packed: int) -> str:
    """Return a packed colour as ``R,G,B``."""
    return f"{packed >> 16},{packed >> 8 & 255},{packed & 255}"


def listed(names: Iterable[str], limit: int = 16) -> str:
    """Return names in a row, the first ones where there are many."""
    shown = list(names)
    return " ".join(shown[:limit] + ["..."] * (len(shown) > limit))
