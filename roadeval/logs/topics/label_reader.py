"""The labels that belong to images, found by header stamps or what takes their place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from roadeval.logs.errors import FrameError
from roadeval.logs.messages.pictures import Picture
from roadeval.logs.messages.video import PictureSequence
from roadeval.logs.topics.labels import Label
from roadeval.logs.topics.pairing import Pairing, Stamps
from roadeval.logs.topics.reader import TopicReader
from roadeval.logs.topics.selection import Clock, LabelTopic, Selection


class _Times:
    """Other numbers in place of stamps, for logs whose stamps are all zero or equal."""

    def __init__(self, times: Sequence[int] | npt.NDArray[np.int64]) -> None:
        self._times = times

    def __len__(self) -> int:
        return len(self._times)

    def stamp(self, position: int) -> int:
        return int(self._times[position])


def _clocks(images: TopicReader, labels: TopicReader, clock: Clock) -> tuple[Stamps, Stamps]:
    """Return the times by which images and labels are paired."""
    if clock is Clock.STAMP:
        return images, labels
    if clock is Clock.LOG_TIME:
        return _Times(images.log_times), _Times(labels.log_times)
    # Without any time, order means something only if there is a label for each image.
    count = len(labels) if len(images) == len(labels) else 0
    return _Times(range(len(images))), _Times(range(count))


class LabelReader:
    """The labels of one topic, each found by its image's position.

    Attributes
    ----------
    unused
        Labels between the ones found that belong to no image; means something only if every
        image is asked for.
    """

    def __init__(
        self, reader: TopicReader, label: LabelTopic, images: TopicReader, selection: Selection
    ) -> None:
        self.reader = reader
        self.unused = 0
        self._images = images
        self._label = label
        self._last: int | None = None
        clocks = _clocks(images, reader, selection.clock)
        self._pairing = Pairing(*clocks, selection.tolerance_ns)

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
        return Label(read_or_error(self.reader, position), self._label.labels, self.reader.name)


def read_or_error(pictures: PictureSequence, position: int) -> Picture | FrameError:
    """Return a picture, or the error that it cannot be read."""
    try:
        return pictures.picture(position)
    except FrameError as error:
        return error
