"""From label images to road truth: 0 non-road, 1 road, 255 ignore."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, NON_ROAD, ROAD, Truth
from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.messages.pictures import Picture
from roadeval.logs.messages.pixels import to_labels, to_rgb

Color = tuple[int, int, int]

UNKNOWN: Final = 254
"""Marks a value of which nobody said what it means."""

_BINARY: Final = (
    {0: NON_ROAD, 255: ROAD, 128: IGNORE},
    {0: NON_ROAD, 1: ROAD, 255: IGNORE},
)


@dataclass(frozen=True, slots=True)
class LabelValues:
    """Which values, or colours, of a label image mean road, and which ignore; all others non-road.

    With none given, a mask is understood by itself if its values are among 0 and 255 (road),
    with 128 for ignore; or among 0 and 1 (road), with 255 for ignore.

    Parameters
    ----------
    road, ignore
        Values of a label image, or indices of one with a palette: 0 to 65535.
    road_colors, ignore_colors
        Colours of a label image: red, green, blue, 0 to 255 each.

    Raises
    ------
    LogError
        If a value or colour cannot occur or means two things, if ignore is given without road,
        or both values and colours.
    """

    road: tuple[int, ...] = ()
    ignore: tuple[int, ...] = ()
    road_colors: tuple[Color, ...] = ()
    ignore_colors: tuple[Color, ...] = ()

    def __post_init__(self) -> None:
        values, colors = {*self.road, *self.ignore}, {*self.road_colors, *self.ignore_colors}
        if values and colors:
            raise LogError("give the truth's labels as values or as colours, not both")
        if self.ignore and not self.road:
            raise LogError("--ignore-label without --road-label: say which label is road")
        if self.ignore_colors and not self.road_colors:
            raise LogError("--ignore-color without --road-color: say which colour is road")
        for value in {*self.road} & {*self.ignore}:
            raise LogError(f"label {value} cannot mean road and ignore at once")
        for color in {*self.road_colors} & {*self.ignore_colors}:
            raise LogError(f"colour {_name(color)} cannot mean road and ignore at once")
        for value in values:
            if not 0 <= value <= 65535:
                raise LogError(f"label {value} cannot occur: labels are 0 to 65535")
        for color in colors:
            if len(color) != 3 or not all(0 <= part <= 255 for part in color):
                raise LogError(f"colour {_name(color)} cannot occur: give R,G,B, 0 to 255 each")


@dataclass(frozen=True, eq=False)
class LabelMap:
    """How to read the pictures of a label topic.

    Parameters
    ----------
    table
        ``(65536,)`` uint8, from label value to truth; a value it marks `UNKNOWN` is an error
        where it occurs.
    colors
        Truth by packed colour; if not empty, the pictures' colours are looked up instead.
    words
        How the labels were understood.
    """

    table: npt.NDArray[np.uint8]
    colors: dict[int, int]
    words: str

    @cached_property
    def strict(self) -> bool:
        """Whether there are values of which nobody said what they mean."""
        return bool((self.table == UNKNOWN).any())

    def read(self, picture: Picture) -> Truth:
        """Decode a label picture to ``(H, W)`` uint8 truth.

        Raises
        ------
        BadMessage
            If it cannot be decoded, or holds an unknown value, or colours instead of values.
        """
        if self.colors:
            return self._of_colors(packed(to_rgb(picture)))
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

            truth: Truth = cv2.LUT(np.ascontiguousarray(labels), self.table[:256])
        else:
            truth = self.table[labels]
        if self.strict and (truth == UNKNOWN).any():
            value = int(labels[truth == UNKNOWN][0])
            raise BadMessage(f"it holds the value {value}, unlike the frames before ({self.words})")
        return truth

    def _of_colors(self, labels: npt.NDArray[np.uint32]) -> Truth:
        truth = np.zeros(labels.shape, np.uint8)
        for color, meaning in self.colors.items():
            truth[labels == color] = meaning
        return truth


def packed(colors: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint32]:
    """``(H, W)`` numbers for ``(H, W, 3)`` colours: red * 65536 + green * 256 + blue."""
    wide = colors.astype(np.uint32)
    return np.asarray(wide[..., 0] << 16 | wide[..., 1] << 8 | wide[..., 2], np.uint32)


def seen_in(picture: Picture, labels: LabelValues, topic: str) -> set[int]:
    """Values, or packed colours, that occur in a label picture.

    Raises
    ------
    BadMessage
        If it cannot be decoded.
    LogError
        If it holds colours, and values are looked for.
    """
    if labels.road_colors:
        return set(np.unique(packed(to_rgb(picture))).tolist())
    pixels = to_labels(picture)
    if pixels.ndim != 2:
        colors = [_unpacked(number) for number in np.unique(packed(pixels)).tolist()]
        raise LogError(
            f"{topic} holds the colours {_listed(map(_name, colors))}: say which mean road "
            "(--road-color R,G,B, repeatable)"
        )
    return set(np.flatnonzero(np.bincount(pixels.ravel())).tolist())


def understand(labels: LabelValues, seen: Iterable[int], topic: str) -> LabelMap:
    """Decide what the values of a label topic mean.

    Parameters
    ----------
    labels
        What the user said.
    seen
        The values, or packed colours, that occur in some of the topic's images.
    topic
        Its name, for messages.

    Raises
    ------
    LogError
        If a given value does not occur, or none is given and the values are class ids.
    """
    values = sorted(set(seen))
    if labels.road_colors:
        return _by_color(labels, values, topic)
    if labels.road:
        return _by_value(labels, values, topic)
    for meaning in _BINARY:
        if set(values) <= set(meaning):
            return _binary(meaning, values)
    raise LogError(
        f"{topic} holds the values {_listed(map(str, values))}: say which mean road "
        "(--road-label V, repeatable) and which to ignore (--ignore-label V)"
    )


def _by_value(labels: LabelValues, seen: list[int], topic: str) -> LabelMap:
    _must_occur("--road-label", labels.road, seen, topic, str)
    _must_occur("--ignore-label", labels.ignore, seen, topic, str)
    table = np.zeros(65536, np.uint8)
    table[list(labels.road)] = ROAD
    table[list(labels.ignore)] = IGNORE
    return LabelMap(table, {}, _words(map(str, labels.road), map(str, labels.ignore)))


def _by_color(labels: LabelValues, seen: list[int], topic: str) -> LabelMap:
    colors = [_unpacked(number) for number in seen]
    _must_occur("--road-color", labels.road_colors, colors, topic, _name)
    _must_occur("--ignore-color", labels.ignore_colors, colors, topic, _name)
    meaning = {_pack(color): ROAD for color in labels.road_colors}
    meaning |= {_pack(color): IGNORE for color in labels.ignore_colors}
    words = _words(map(_name, labels.road_colors), map(_name, labels.ignore_colors))
    return LabelMap(np.zeros(65536, np.uint8), meaning, words)


def _binary(meaning: dict[int, int], values: list[int]) -> LabelMap:
    table = np.full(65536, UNKNOWN, np.uint8)
    table[list(meaning)] = list(meaning.values())
    road = [str(value) for value, truth in meaning.items() if truth == ROAD]
    ignored = [str(value) for value in values if meaning[value] == IGNORE]
    words = f"a mask of {_listed(map(str, values))}: {_words(road, ignored)}"
    return LabelMap(table, {}, words)


def _must_occur(
    option: str, wanted: Sequence[Any], seen: Sequence[Any], topic: str, name: Any
) -> None:
    for value in wanted:
        if value not in seen:
            raise LogError(
                f"{option} {name(value)} does not occur in {topic}, whose frames hold "
                f"{_listed(map(name, seen))}"
            )


def _words(road: Iterable[str], ignored: Iterable[str]) -> str:
    left_out = _listed(ignored)
    return f"road is {_listed(road)}" + (f", {left_out} is ignored" if left_out else "")


def _listed(names: Iterable[str], limit: int = 16) -> str:
    shown = list(names)
    return " ".join(shown[:limit] + ["..."] * (len(shown) > limit))


def _name(color: Iterable[int]) -> str:
    return ",".join(str(part) for part in color)


def _pack(color: Color) -> int:
    return color[0] << 16 | color[1] << 8 | color[2]


def _unpacked(number: int) -> Color:
    return number >> 16, number >> 8 & 255, number & 255
