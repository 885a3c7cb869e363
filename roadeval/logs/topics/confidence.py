"""Confidence maps: how probable road is, pixel by pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, TypeGuard

import numpy as np

from roadeval.data import Mask, Probability
from roadeval.images import Limits
from roadeval.logs.errors import BadMessage
from roadeval.logs.messages.pictures import Picture, RawPicture
from roadeval.logs.messages.pixel_formats import format_of, rows_of
from roadeval.logs.messages.pixels import lossy_format, to_labels

TOP: Final = np.iinfo(np.uint16).max
"""The code of certainty."""


def holds_fractions(picture: Picture) -> TypeGuard[RawPicture]:
    """Return whether numbers of a picture have fractions, and are not whole."""
    return isinstance(picture, RawPicture) and format_of(picture).dtype == "f4"


@dataclass(frozen=True, slots=True)
class Confidence:
    """How confidence maps are read: road is what has at least the ``threshold``, from 0 to 1."""

    threshold: float

    @property
    def words(self) -> str:
        """The meaning in words."""
        return f"a confidence map: road is {self.threshold:g} or more"

    def road(self, probability: Probability) -> Mask:
        """Return the road of ``(H, W)`` uint16 codes."""
        return (probability >= self.threshold * TOP).astype(np.uint8)

    def read(self, picture: Picture, limits: Limits) -> Probability:
        """Decode a confidence map to ``(H, W)`` uint16 codes 0..65535 that span 0..1.

        Raises
        ------
        BadMessage
            If it cannot be decoded, holds colours or a number beyond 0..1, or is compressed in a
            way that changes values.
        """
        if name := lossy_format(picture):
            raise BadMessage(f"a {name}, whose compression changes confidences")
        if holds_fractions(picture):
            values = rows_of(picture, format_of(picture), limits)
            if not ((values >= 0) & (values <= 1)).all():
                raise BadMessage("it holds a confidence that is not from 0 to 1")
            return np.rint(values.astype(np.float64) * TOP).astype(np.uint16)
        levels = to_labels(picture, limits)
        if levels.ndim != 2:
            raise BadMessage("it holds colours, not confidences")
        # 257 times 255 is 65535.
        return levels.astype(np.uint16) * 257 if levels.dtype == np.uint8 else levels
