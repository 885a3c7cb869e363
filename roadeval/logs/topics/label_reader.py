"""The labels that belong to images, found by header stamps or what takes their place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from roadeval.images import Limits
from roadeval.logs.errors import FrameError
from roadeval.logs.messages.pictures import Picture
from roadeval.logs.messages.video import PictureSequence
from roadeval.logs.topics.labels import Label, Meaning
from roadeval.logs.topics.pairing import UNREADABLE, Pairing, Stamps
from roadeval.logs.topics.reader import TopicReader
from roadeval.logs.topics.selection import Clock

Clocks = tuple[Stamps, Stamps]
"""The times by which images and labels are paired."""


class LabelPictures(PictureSequence, Stamps, Protocol):
    """Label pictures in the order of their times: a topic's, or a folder's."""

    @property
    def name(self) -> str:
        """The topic, or the folder."""

    @property
    def limits(self) -> Limits:
        """On the pictures."""

    @property
    def log_times(self) -> npt.NDArray[np.int64]:
        """``(n,)`` int64, rising."""

    @property
    def sure(self) -> int:
        """How many of them, from the first one on, surely have the positions they were made at."""

    def __len__(self) -> int: ...

    def place(self, position: int) -> str:
        """Return where a picture lies, for messages to people."""
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


def clocks_of(images: TopicReader, labels: LabelPictures, clock: Clock) -> Clocks:
    """Return the times by which images and labels are paired."""
    if clock is Clock.STAMP:
        return images, labels
    if clock is Clock.LOG_TIME:
        return Times(images.log_times), Times(labels.log_times)
    # Without any time, order means something only if there is a label for each image.
    count = len(labels) if len(images) == len(labels) else 0
    return Times(range(len(images)), images.sure), Times(range(min(count, labels.sure)))


class LabelReader:
    """The labels of one topic, or folder, each found by its image's position.

    Parameters
    ----------
    reader
        The labels' pictures.
    meaning
        How they are read.
    images
        The camera's topic.
    clocks, tolerance_ns
        By what they are paired, and how far apart a pair may be.

    Attributes
    ----------
    unused
        Labels between the ones found that belong to no image; means something only if every
        image is asked for.
    """

    def __init__(
        self,
        reader: LabelPictures,
        meaning: Meaning,
        images: TopicReader,
        clocks: Clocks,
        tolerance_ns: int,
    ) -> None:
        self.reader = reader
        self.unused = 0
        self._images = images
        self._meaning = meaning
        self._last: int | None = None
        self._pairing = Pairing(*clocks, tolerance_ns)

    def of(self, image: int) -> Label | None:
        """Find the label of the image at a position."""
        if self._last is None:
            logged = self._images.log_times[image]
            self._pairing.begin_near(int(np.searchsorted(self.reader.log_times, logged)))
        position = self._pairing.partner(image)
        if position is None:
            return None
        if self._last is not None:
            self.unused += max(position - self._last - 1, 0)
        self._last = position
        picture, place = read_or_error(self.reader, position), self.reader.place(position)
        return Label(picture, self._meaning, self.reader.name, place)


def read_or_error(pictures: PictureSequence, position: int) -> Picture | FrameError:
    """Return a picture, or the error that it cannot be read."""
    try:
        return pictures.picture(position)
    except FrameError as error:
        return error
