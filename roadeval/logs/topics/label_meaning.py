"""How the meaning of label values is found: as the settings say, or by the values themselves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Final

from roadeval.data import IGNORE, NON_ROAD, ROAD
from roadeval.logs.errors import LogError
from roadeval.logs.settings import Color, LabelSettings
from roadeval.logs.topics.label_map import FRINGE, UNKNOWN, LabelMap, color_name, listed

_MASKS: Final = (
    {0: NON_ROAD, 255: ROAD, 128: IGNORE},
    {0: NON_ROAD, 1: ROAD, 255: IGNORE},
)
"""Masks that need no settings: what their values mean."""


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
        f"{topic} holds the values {listed(map(str, values))}: name those that mean road with "
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
    name = color_name if by_color else str
    help_ = "; say with `drives` what holds for this drive alone" if several else ""
    for setting, wanted in given.items():
        for value in wanted:
            if value not in seen:
                raise LogError(
                    f"{setting} {name(value)} does not occur in {topic}, whose frames hold "
                    f"{listed(map(name, seen))}{help_}"
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
                f"{listed(map(str, seen))}"
            )
    words = f"{_words(map(str, road), map(str, ignore))}, 0 is non-road, each within {tolerance}"
    return LabelMap(meaning, FRINGE, False, words, tolerance)


def _as_mask(meaning: dict[int, int], seen: list[int]) -> LabelMap:
    road = [str(value) for value, truth in meaning.items() if truth == ROAD]
    ignored = [str(value) for value in seen if meaning[value] == IGNORE]
    words = f"a mask of {listed(map(str, seen))}: {_words(road, ignored)}"
    return LabelMap(meaning, UNKNOWN, False, words)


def _words(road: Iterable[str], ignored: Iterable[str]) -> str:
    left_out = listed(ignored)
    return f"road is {listed(road)}" + (f", {left_out} is ignored" if left_out else "")


def _packed(color: Color) -> int:
    return color[0] << 16 | color[1] << 8 | color[2]
