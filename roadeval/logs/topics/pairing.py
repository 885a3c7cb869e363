"""Pairs of images and labels by header stamp, in whole nanoseconds.

Labels may be logged long after their images, so log times do not pair them. Stamps are read only
where they are needed: around the stamp that is looked for.
"""

from __future__ import annotations

from typing import Final, Protocol

UNREADABLE: Final = -(2**63) + 1
"""A stamp that cannot be read."""
REACH: Final = 4
"""Messages to look at on either side: topics are logged nearly, not always, in stamp order."""


class Stamps(Protocol):
    """The stamps of a topic's messages, in the order of their log times."""

    def __len__(self) -> int: ...

    def stamp(self, position: int) -> int:
        """Nanoseconds, or `UNREADABLE`."""
        ...


class Pairing:
    """Pairs each image with at most one label, and each label with at most one image.

    Equal stamps are a pair (the k-th image with a stamp and the k-th label with it); else the
    nearest within the tolerance, if each is the other's nearest.

    Parameters
    ----------
    images, labels
        Both nearly in the order of their stamps.
    tolerance_ns
        Largest difference of stamps of a pair.
    """

    def __init__(self, images: Stamps, labels: Stamps, tolerance_ns: int) -> None:
        self._images = images
        self._labels = labels
        self._tolerance = tolerance_ns
        self._near_label = 0

    def begin_near(self, label: int) -> None:
        """Search for the next partner around a label, without reading the stamps before it."""
        self._near_label = min(label, max(len(self._labels) - 1, 0))

    def partner(self, image: int) -> int | None:
        """Position of the label that belongs to the image at a position, if there is one."""
        stamp = self._images.stamp(image)
        if stamp == UNREADABLE or not len(self._labels):
            return None
        self._near_label = _closest(self._labels, stamp, self._near_label)
        exact = _equal(self._labels, stamp, self._near_label)
        if exact:
            rank = _equal(self._images, stamp, image).index(image)
            return exact[rank] if rank < len(exact) else None
        return self._nearest(image, stamp)

    def _nearest(self, image: int, stamp: int) -> int | None:
        label = self._near_label
        theirs = self._labels.stamp(label)
        if theirs == UNREADABLE or abs(theirs - stamp) > self._tolerance:
            return None
        return label if _closest(self._images, theirs, image) == image else None


def _closest(stamps: Stamps, stamp: int, hint: int) -> int:
    """Position whose stamp is nearest to ``stamp`` (the first of equals), sought from a hint."""
    middle = _seek(stamps, stamp, hint)
    around = range(max(middle - REACH, 0), min(middle + REACH + 1, len(stamps)))
    return min(around, key=lambda position: (_distance(stamps, position, stamp), position))


def _distance(stamps: Stamps, position: int, stamp: int) -> int:
    theirs = stamps.stamp(position)
    return 2**64 if theirs == UNREADABLE else abs(theirs - stamp)


def _equal(stamps: Stamps, stamp: int, middle: int) -> list[int]:
    around = range(max(middle - REACH, 0), min(middle + REACH + 1, len(stamps)))
    return [position for position in around if stamps.stamp(position) == stamp]


def _seek(stamps: Stamps, stamp: int, hint: int) -> int:
    """First position at or after ``stamp``, by ever longer steps from the hint, then halving."""
    low, high, step = hint, hint, 1
    while low > 0 and _at(stamps, low) >= stamp:
        low, high, step = max(low - step, 0), low, step * 2
    step = 1
    while high < len(stamps) and _at(stamps, high) < stamp:
        low, high, step = high, min(high + step, len(stamps)), step * 2
    while low < high:
        middle = (low + high) // 2
        if _at(stamps, middle) < stamp:
            low = middle + 1
        else:
            high = middle
    return min(low, len(stamps) - 1)


def _at(stamps: Stamps, position: int) -> int:
    """Stamp at a position, or of the next one that can be read."""
    for candidate in range(position, min(position + REACH, len(stamps))):
        stamp = stamps.stamp(candidate)
        if stamp != UNREADABLE:
            return stamp
    return UNREADABLE
