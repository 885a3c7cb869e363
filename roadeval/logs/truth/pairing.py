"""Pairs of images and labels by header stamp, in whole nanoseconds, or by what takes its place.

Labels may be logged long after their images, so log times do not pair them. Stamps are read only
where they are needed: around the stamp that is looked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import islice
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from roadeval.logs.topics.description import TopicInfo, median_period
from roadeval.logs.topics.reader import UNREADABLE, TopicReader

REACH: Final = 4
"""Messages to look at on either side: topics are logged nearly, not always, in stamp order."""
ALONE_NS: Final = 50_000_000
"""Half the period of a camera of 10 Hz."""
LOOKED_AT: Final = 10
"""Images at the log's start that settle by what they are paired."""


class Stamps(Protocol):
    """The stamps of pictures, nearly rising."""

    def __len__(self) -> int: ...

    def stamp(self, position: int) -> int:
        """Nanoseconds, or `UNREADABLE`."""
        ...


class Times:
    """Other numbers in place of stamps, for logs whose stamps are all zero or equal.

    Parameters
    ----------
    times
        By position, rising.
    sure
        How many of them are known; the others count as unreadable. By default all are.
    """

    def __init__(
        self, times: Sequence[int] | npt.NDArray[np.int64], sure: int | None = None
    ) -> None:
        self._times = times
        self._sure = len(times) if sure is None else sure

    def __len__(self) -> int:
        return len(self._times)

    def stamp(self, position: int) -> int:
        """Return the number at a position, or `UNREADABLE`."""
        return int(self._times[position]) if position < self._sure else UNREADABLE


class Clock(StrEnum):
    """By what images and labels are paired."""

    STAMP = "header stamps"
    LOG_TIME = "log times"
    ORDER = "their order"


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """The images of a log that labels are paired with, and by which rules."""

    images: TopicReader
    topic: TopicInfo
    clock: Clock
    """Header stamps if they differ, else log times, else their order."""
    tolerance_ns: int
    """How far an image and its label may be apart."""
    resize_labels: bool
    """Whether labels of another size are scaled to the image's (nearest pixel)."""

    @classmethod
    def of(
        cls, images: TopicReader, topic: TopicInfo, asked_ms: float | None, *, resize_labels: bool
    ) -> Camera:
        """Find the rules for a topic: a tolerance of half the frame period unless one is given."""
        return cls(images, topic, clock_of(images), tolerance(images, asked_ms), resize_labels)


def clock_of(reader: TopicReader) -> Clock:
    """Return what differs among the first images of a topic."""
    stamps = (reader.stamp(position) for position in range(len(reader)))
    known = list(islice((stamp for stamp in stamps if stamp != UNREADABLE), LOOKED_AT))
    if len(set(known)) > 1 or (len(known) == 1 and any(known)):
        return Clock.STAMP
    times = reader.log_times[:LOOKED_AT]
    return Clock.LOG_TIME if len(times) <= 1 or times[0] != times[-1] else Clock.ORDER


def tolerance(reader: TopicReader, asked_ms: float | None) -> int:
    """Return the tolerance asked for, or else half the frame period, in nanoseconds.

    An image alone has no period; what is within `ALONE_NS` of it belongs to it.
    """
    if asked_ms is not None:
        return round(asked_ms * 1e6)
    if len(reader) == 1:
        return ALONE_NS
    period = median_period(reader.log_times)
    if period == 0:
        stamps = sorted(reader.stamp(position) for position in range(min(LOOKED_AT, len(reader))))
        known = [stamp for stamp in stamps if stamp != UNREADABLE]
        period = median_period(np.array(known, np.int64))
    return period // 2


@dataclass(frozen=True, slots=True, eq=False)
class Pairing:
    """By what images and labels are paired.

    Equal stamps are a pair (the k-th image with a stamp and the k-th label with it); else the
    nearest within the tolerance, if each is the other's nearest.
    """

    images: Stamps
    labels: Stamps
    """Both nearly in the order of their stamps, or of the numbers that take their place."""
    tolerance: int
    """Largest difference of the stamps of a pair."""
    unused: int = 0
    """Labels that belong to no frame of the log, as far as that is known beforehand."""
    unsure: int = 0
    """Frames without a label because their number is not certain: an unknown number of images, or
    of the other log's labels, is lost before them."""

    def begin(self, near: int = 0) -> Partners:
        """Begin to pair image after image, the first one with a label near a position."""
        return Partners(self, near)


class Partners:
    """Finds each image's label, and each label's image: at most one.

    Attributes
    ----------
    unused
        Labels between the ones found that belong to no image; means something only if every
        image is asked for.
    """

    def __init__(self, pairing: Pairing, near: int) -> None:
        self.unused = 0
        self._images = pairing.images
        self._labels = pairing.labels
        self._tolerance = pairing.tolerance
        self._near_label = min(near, max(len(pairing.labels) - 1, 0))
        self._last: int | None = None

    def of(self, image: int) -> int | None:
        """Position of the label that belongs to the image at a position, if there is one."""
        stamp = self._images.stamp(image)
        if stamp == UNREADABLE or not len(self._labels):
            return None
        self._near_label = _closest(self._labels, stamp, self._near_label)
        exact = _equal(self._labels, stamp, self._near_label)
        if exact:
            rank = _equal(self._images, stamp, image).index(image)
            found = exact[rank] if rank < len(exact) else None
        else:
            found = self._nearest(image, stamp)
        if found is not None:
            if self._last is not None:
                self.unused += max(found - self._last - 1, 0)
            self._last = found
        return found

    def _nearest(self, image: int, stamp: int) -> int | None:
        label = self._near_label
        theirs = self._labels.stamp(label)
        if theirs == UNREADABLE or abs(theirs - stamp) > self._tolerance:
            return None
        return label if _closest(self._images, theirs, image) == image else None


def _closest(stamps: Stamps, stamp: int, hint: int) -> int:
    """Position whose stamp is nearest to ``stamp`` (the first of equals), sought from a hint."""

    def distance(position: int) -> int:
        theirs = stamps.stamp(position)
        return 2**64 if theirs == UNREADABLE else abs(theirs - stamp)

    around = _around(stamps, _seek(stamps, stamp, hint))
    return min(around, key=lambda position: (distance(position), position))


def _equal(stamps: Stamps, stamp: int, middle: int) -> list[int]:
    return [place for place in _around(stamps, middle) if stamps.stamp(place) == stamp]


def _around(stamps: Stamps, middle: int) -> range:
    return range(max(middle - REACH, 0), min(middle + REACH + 1, len(stamps)))


def _seek(stamps: Stamps, stamp: int, hint: int) -> int:
    """First position at or after ``stamp``, by ever longer steps from the hint, then halving."""

    def at(position: int) -> int:
        """Stamp at a position, or of the next one that can be read."""
        for candidate in range(position, min(position + REACH, len(stamps))):
            if (found := stamps.stamp(candidate)) != UNREADABLE:
                return found
        return UNREADABLE

    low, high, step = hint, hint, 1
    while low > 0 and at(low) >= stamp:
        low, high, step = max(low - step, 0), low, step * 2
    step = 1
    while high < len(stamps) and at(high) < stamp:
        low, high, step = high, min(high + step, len(stamps)), step * 2
    while low < high:
        middle = (low + high) // 2
        if at(middle) < stamp:
            low = middle + 1
        else:
            high = middle
    return min(low, len(stamps) - 1)
