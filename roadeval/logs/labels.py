"""From label images to road truth: 0 non-road, 1 road, 255 ignore."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, NON_ROAD, ROAD, Truth
from roadeval.logs.errors import LogError
from roadeval.logs.messages import BadMessage

UNKNOWN: Final = 254
"""Marks a value of which nobody said what it means."""

_BINARY: Final = (
    {0: NON_ROAD, 255: ROAD, 128: IGNORE},
    {0: NON_ROAD, 1: ROAD, 255: IGNORE},
)


@dataclass(frozen=True, slots=True)
class LabelValues:
    """Which values of a label image mean road, and which mean ignore; all others are non-road.

    With neither given, a mask is understood by itself if its values are among 0 and 255 (road),
    with 128 for ignore; or among 0 and 1 (road), with 255 for ignore.
    """

    road: tuple[int, ...] = ()
    ignore: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        both = sorted(set(self.road) & set(self.ignore))
        if both:
            raise LogError(f"label {both[0]} cannot mean road and ignore at once")
        if self.ignore and not self.road:
            raise LogError("--ignore-label without --road-label: say which label is road")
        for value in (*self.road, *self.ignore):
            if not 0 <= value <= 65535:
                raise LogError(f"label {value} cannot occur: labels are 0 to 65535")


@dataclass(frozen=True, slots=True, eq=False)
class LabelMap:
    """A table from label value to truth.

    ``table`` is ``(65536,)`` uint8; a value it marks `UNKNOWN` is an error where it occurs.
    ``words`` says how the labels were understood.
    """

    table: npt.NDArray[np.uint8]
    words: str

    def apply(self, labels: npt.NDArray[Any]) -> Truth:
        """Translate ``(H, W)`` uint8 or uint16 labels.

        Raises
        ------
        BadMessage
            If a value is unknown, or the image holds colours.
        """
        if labels.ndim != 2:
            raise BadMessage("it holds colours, not label values")
        if labels.dtype == np.uint8:
            import cv2

            truth: Truth = np.asarray(cv2.LUT(labels, self.table[:256]), np.uint8)
        else:
            truth = self.table[labels]
        if (truth == UNKNOWN).any():
            value = int(labels[truth == UNKNOWN][0])
            raise BadMessage(f"it holds the value {value}, unlike the frames before ({self.words})")
        return truth


def understand(labels: LabelValues, seen: Iterable[int], topic: str) -> LabelMap:
    """Decide what the values of a label topic mean.

    Parameters
    ----------
    labels
        What the user said.
    seen
        The values that occur in some of the topic's images.
    topic
        Its name, for messages.

    Raises
    ------
    LogError
        If a given value does not occur, or none is given and the values are class ids.
    """
    values = sorted(set(seen))
    if labels.road:
        return _explicit(labels, values, topic)
    for meaning in _BINARY:
        if set(values) <= set(meaning):
            return _binary({value: meaning[value] for value in meaning}, values)
    raise LogError(
        f"{topic} holds the values {_listed(values)}: say which mean road (--road-label V, "
        "repeatable) and which to ignore (--ignore-label V)"
    )


def _explicit(labels: LabelValues, values: list[int], topic: str) -> LabelMap:
    for option, wanted in (("--road-label", labels.road), ("--ignore-label", labels.ignore)):
        missing = sorted(set(wanted) - set(values))
        if missing:
            raise LogError(
                f"{option} {missing[0]} does not occur in {topic}, whose frames hold "
                f"{_listed(values)}"
            )
    table = np.zeros(65536, np.uint8)
    table[list(labels.road)] = ROAD
    table[list(labels.ignore)] = IGNORE
    words = f"road is {_listed(labels.road)}"
    if labels.ignore:
        words += f", {_listed(labels.ignore)} is ignored"
    return LabelMap(table, words)


def _binary(meaning: dict[int, int], values: list[int]) -> LabelMap:
    table = np.full(65536, UNKNOWN, np.uint8)
    for value, truth in meaning.items():
        table[value] = truth
    road = next(value for value, truth in meaning.items() if truth == ROAD)
    ignored = [value for value in values if meaning[value] == IGNORE]
    words = f"a mask of {_listed(values)}: road is {road}"
    if ignored:
        words += f", {ignored[0]} is ignored"
    return LabelMap(table, words)


def _listed(values: Iterable[int], limit: int = 16) -> str:
    shown = [str(value) for value in values]
    more = [] if len(shown) <= limit else ["..."]
    return " ".join(shown[:limit] + more)
