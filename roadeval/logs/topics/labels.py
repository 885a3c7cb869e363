"""Road truth from label images: 0 non-road, 1 road, 255 ignore."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, NON_ROAD, ROAD, Truth
from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.messages.pictures import Picture
from roadeval.logs.messages.pixels import to_labels, to_rgb
from roadeval.logs.settings import Color, LabelSettings

UNKNOWN: Final = 254
"""Marks a value whose meaning is not known."""

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
        Truth of any other value; with `UNKNOWN` such a value is an error where it occurs.
    by_color
        Whether colours are looked up instead of values.
    words
        The meaning in words.
    """

    meaning: Mapping[int, int]
    others: int
    by_color: bool
    words: str

    @property
    def by_itself(self) -> bool:
        """Whether a mask was understood without settings."""
        return self.others == UNKNOWN

    @cached_property
    def _table(self) -> npt.NDArray[np.uint8]:
        """``(65536,)`` truth by label value."""
        table = np.full(65536, self.others, np.uint8)
        table[list(self.meaning)] = list(self.meaning.values())
        return table

    def read(self, picture: Picture) -> Truth:
        """Decode a label picture to ``(H, W)`` uint8 truth.

        Raises
        ------
        BadMessage
            If it cannot be decoded, or holds an unknown value, or colours instead of values.
        """
        if self.by_color:
            return self._of_colors(pack_colors(to_rgb(picture)))
        labels = to_labels(picture)
        if labels.ndim != 2:
            raise BadMessage("it holds colours, not label values")
        return self.of_values(labels)

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


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A label's picture, or why it cannot be read, and what its values mean."""

    picture: Picture | FrameError
    labels: LabelMap
    topic: str


def pack_colors(colors: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint32]:
    """``(H, W)`` numbers for ``(H, W, 3)`` colours: red * 65536 + green * 256 + blue."""
    wide = colors.astype(np.uint32)
    return np.asarray(wide[..., 0] << 16 | wide[..., 1] << 8 | wide[..., 2], np.uint32)


def seen_in(picture: Picture, labels: LabelSettings, topic: str) -> set[int]:
    """Return the values, or packed colours, that occur in a label picture.

    Raises
    ------
    BadMessage
        If it cannot be decoded.
    LogError
        If it holds colours, and values are looked for.
    """
    if labels.road_colors:
        return set(np.unique(pack_colors(to_rgb(picture))).tolist())
    pixels = to_labels(picture)
    if pixels.ndim != 2:
        colors = map(_color_name, np.unique(pack_colors(pixels)).tolist())
        raise LogError(
            f"{topic} holds the colours {_listed(colors)}: name those that mean road with "
            "`labels.road_colors`"
        )
    return set(np.flatnonzero(np.bincount(pixels.ravel())).tolist())


def understand(
    labels: LabelSettings, seen: Iterable[int], topic: str, *, several: bool = False
) -> LabelMap:
    """Decide what the values of a label topic mean.

    Parameters
    ----------
    labels
        The meaning as the user gave it.
    seen
        The values, or packed colours, that occur in some of the topic's images.
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
    values = sorted(set(seen))
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
        if set(values) <= set(meaning):
            return _as_mask(meaning, values)
    raise LogError(
        f"{topic} holds the values {_listed(map(str, values))}: name those that mean road with "
        "`labels.road`, and those to leave out with `labels.ignore`"
    )


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
