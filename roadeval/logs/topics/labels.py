"""Road truth from label images: 0 non-road, 1 road, 255 ignore."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadeval.data import Probability, Truth
from roadeval.images import Limits
from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.messages.pictures import Picture
from roadeval.logs.messages.pixels import lossy_format, to_labels, to_rgb
from roadeval.logs.settings import LabelSettings
from roadeval.logs.topics.confidence import Confidence
from roadeval.logs.topics.label_map import LabelMap, color_name, listed, pack_colors

Meaning = LabelMap | Confidence
"""How the pictures of a topic, or of a folder, are read."""


@dataclass(frozen=True, slots=True, eq=False)
class LabelPixels:
    """A decoded label: its truth, how many pixels of it are fringes, and a map's probability."""

    truth: Truth
    fringe: int = 0
    probability: Probability | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A label's picture, or why it cannot be read, and how it is read.

    ``topic`` is the topic or folder that it comes from, ``place`` that or its own file.
    """

    picture: Picture | FrameError
    meaning: Meaning
    topic: str
    place: str

    def read(self, limits: Limits) -> LabelPixels:
        """Decode the label.

        Raises
        ------
        BadMessage, FrameError
            If it cannot be read or decoded.
        """
        if isinstance(self.picture, FrameError):
            raise self.picture
        if isinstance(self.meaning, LabelMap):
            return LabelPixels(*self.meaning.read(self.picture, limits))
        probability = self.meaning.read(self.picture, limits)
        return LabelPixels(self.meaning.road(probability), probability=probability)


def seen_in(picture: Picture, labels: LabelSettings, topic: str, limits: Limits) -> set[int]:
    """Return the values, or packed colours, that occur in a label picture.

    Raises
    ------
    BadMessage
        If it cannot be decoded.
    LogError
        If it holds colours, and values are looked for; or is compressed in a way that changes
        values, without a tolerance for that.
    """
    if labels.tolerance is None and (name := lossy_format(picture)):
        raise LogError(f"{topic} {lossy(name)}")
    if labels.road_colors:
        return set(np.unique(pack_colors(to_rgb(picture, limits))).tolist())
    pixels = to_labels(picture, limits)
    if pixels.ndim != 2:
        colors = map(color_name, np.unique(pack_colors(pixels)).tolist())
        raise LogError(
            f"{topic} holds the colours {listed(colors)}: name those that mean road with "
            "`labels.road_colors`"
        )
    return set(np.flatnonzero(np.bincount(pixels.ravel())).tolist())


def lossy(name: str) -> str:
    """Return what is wrong with label images in a format that changes values, and the way out."""
    return (
        f"is {name}, whose compression changes the values at every edge: log labels as PNG, or "
        "give `labels.tolerance` (32, for example), and values farther than that from 0 and from "
        "those that mean road are ignored"
    )
