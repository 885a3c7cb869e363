"""Road truth from label images: 0 non-road, 1 road, 255 ignore."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, NON_ROAD, ROAD, Probability, Truth
from roadeval.images import Limits
from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.messages.pictures import Picture
from roadeval.logs.messages.pixels import lossy_format, to_labels, to_rgb
from roadeval.logs.settings import Color, LabelSettings
from roadeval.logs.topics.confidence import Confidence

UNKNOWN: Final = 254
"""Marks a value whose meaning is not known."""
FRINGE: Final = 253
"""Marks a value that lies too far from every known one, as compression makes them at edges."""

_MASKS: Final = (
    {0: NON_ROAD, 255: ROAD, 128: IGNORE},
    {0: NON_ROAD, 1: ROAD, 255: IGNORE},
)
"""Masks that need no settings: what their values mean."""


@dataclass(frozen=True, eq=False)
class LabelMap:
    """What the values, or the colours, of a topic's label images mean.

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


def pack_colors(colors: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint32]:
    """``(H, W)`` numbers for ``(H, W, 3)`` colours: red * 65536 + green * 256 + blue."""
    wide = colors.astype(np.uint32)
    return np.asarray(wide[..., 0] << 16 | wide[..., 1] << 8 | wide[..., 2], np.uint32)


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
        colors = map(_color_name, np.unique(pack_colors(pixels)).tolist())
        raise LogError(
            f"{topic} holds the colours {_listed(colors)}: name those that mean road with "
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


def understand(
    labels: LabelSettings, seen: Iterable[int], topic: str, *, several: bool = False
) -> LabelMap:
    """Decide what the values of a label topic mean.

    Parameters
    ----------
    labels
        The meaning as the user gave it.
    seen
        The values, or packed colours, that occur in some of the topic's images, once for each image
        in which they do.
    topic
        Its name, for messages.
    several
        Whether the labels are given for several logs at once. Then a mask that needs no settings
        is understood by itself where none of the given values occurs in it.

    Raises
    ------
    LogError
        If a given value does not occur, or none is given and the values are class ids.
    """
    images = Counter(seen)
    values = sorted(images)
    if labels.tolerance is not None:
        return _within(labels, labels.tolerance, values, topic)
    if several and _is_mask_of_its_own(labels, values):
        labels = LabelSettings()
    if labels.road_colors:
        road, ignore = map(_packed, labels.road_colors), map(_packed, labels.ignore_colors)
        given = {"`labels.road_colors`": tuple(road), "`labels.ignore_colors`": tuple(ignore)}
        return _as_given(given, values, topic, by_color=True, several=several)
    if labels.road:
        given = {"`labels.road`": labels.road, "`labels.ignore`": labels.ignore}
        return _as_given(given, values, topic, by_color=False, several=several)
    for meaning in _MASKS:
        if set(values) <= set(meaning) and _is_plain(meaning, images):
            return _as_mask(meaning, values)
    raise LogError(
        f"{topic} holds the values {_listed(map(str, values))}: name those that mean road with "
        "`labels.road`, and those to leave out with `labels.ignore`"
    )


def _is_plain(meaning: Mapping[int, int], images: Mapping[int, int]) -> bool:
    """Whether values leave no doubt about their meaning, by the number of images that have each.

    A 1 in few images of a mask of 0 and 255 may be damage: were it road, all the road would be
    ignored.
    """
    road = next(value for value, truth in meaning.items() if truth == ROAD)
    return road > 1 or 2 * images.get(road, 0) >= images.get(255, 0)


def _is_mask_of_its_own(labels: LabelSettings, seen: list[int]) -> bool:
    """Whether values are those of a mask of 0 and 255, and none of them is one that was given.

    A mask of 0 and 1 could as well be class ids of a log without the given ones.
    """
    return {255} <= set(seen) <= set(_MASKS[0]) - {*labels.road, *labels.ignore}


def _as_given(
    given: Mapping[str, tuple[int, ...]],
    seen: list[int],
    topic: str,
    *,
    by_color: bool,
    several: bool,
) -> LabelMap:
    """Return the meaning that the settings give to road and to ignore, in this order."""
    name = _color_name if by_color else str
    help_ = "; say with `drives` what holds for this drive alone" if several else ""
    for setting, wanted in given.items():
        for value in wanted:
            if value not in seen:
                raise LogError(
                    f"{setting} {name(value)} does not occur in {topic}, whose frames hold "
                    f"{_listed(map(name, seen))}{help_}"
                )
    road, ignore = given.values()
    meaning = dict.fromkeys(road, ROAD) | dict.fromkeys(ignore, IGNORE)
    return LabelMap(meaning, NON_ROAD, by_color, _words(map(name, road), map(name, ignore)))


def _within(labels: LabelSettings, tolerance: int, seen: list[int], topic: str) -> LabelMap:
    """Return the meaning of a mask whose values are near the known ones: 0 is non-road."""
    road, ignore = labels.road or (255,), labels.ignore
    meaning = {0: NON_ROAD} | dict.fromkeys(road, ROAD) | dict.fromkeys(ignore, IGNORE)
    known = sorted(meaning)
    for low, high in pairwise(known):
        if meaning[low] != meaning[high] and high - low <= 2 * tolerance:
            raise LogError(
                f"{topic}: `labels.tolerance` {tolerance} does not keep {low} and {high} apart"
            )
    for value in (*labels.road, *ignore):
        if not any(abs(value - each) <= tolerance for each in seen):
            raise LogError(
                f"{topic} holds nothing within {tolerance} of {value}; its frames hold "
                f"{_listed(map(str, seen))}"
            )
    words = f"{_words(map(str, road), map(str, ignore))}, 0 is non-road, each within {tolerance}"
    return LabelMap(meaning, FRINGE, False, words, tolerance)


def _as_mask(meaning: dict[int, int], seen: list[int]) -> LabelMap:
    road = [str(value) for value, truth in meaning.items() if truth == ROAD]
    ignored = [str(value) for value in seen if meaning[value] == IGNORE]
    words = f"a mask of {_listed(map(str, seen))}: {_words(road, ignored)}"
    return LabelMap(meaning, UNKNOWN, False, words)


def _words(road: Iterable[str], ignored: Iterable[str]) -> str:
    left_out = _listed(ignored)
    return f"road is {_listed(road)}" + (f", {left_out} is ignored" if left_out else "")


def _listed(names: Iterable[str], limit: int = 16) -> str:
    shown = list(names)
    return " ".join(shown[:limit] + ["..."] * (len(shown) > limit))


def _packed(color: Color) -> int:
    return color[0] << 16 | color[1] << 8 | color[2]


def _color_name(packed: int) -> str:
    return f"{packed >> 16},{packed >> 8 & 255},{packed & 255}"
