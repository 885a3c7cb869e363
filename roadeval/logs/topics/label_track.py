"""The labels of a log's images, found by header stamps or whatever takes their place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from roadeval.logs.errors import FrameError
from roadeval.logs.logged import Label
from roadeval.logs.messages.pictures import Picture
from roadeval.logs.messages.video import Pictures
from roadeval.logs.topics.pairing import Pairing, Stamps
from roadeval.logs.topics.selection import Clock, LabelTopic, Selection
from roadeval.logs.topics.track import Track


class _Times:
    """Other numbers in the place of stamps, for logs whose stamps tell nothing."""

    def __init__(self, times: Sequence[int] | npt.NDArray[np.int64]) -> None:
        self._times = times

    def __len__(self) -> int:
        return len(self._times)

    def stamp(self, position: int) -> int:
        return int(self._times[position])


def _clocks(images: Track, labels: Track, clock: Clock) -> tuple[Stamps, Stamps]:
    """Give what tells which label belongs to which image."""
    if clock is Clock.STAMP:
        return images, labels
    if clock is Clock.LOG_TIME:
        return _Times(images.log_times), _Times(labels.log_times)
    # Without any time, order means something only if there is a label for each image.
    count = len(labels) if len(images) == len(labels) else 0
    return _Times(range(len(images))), _Times(range(count))


class LabelTrack:
    """The labels of one topic, each found by its image's position.

    Attributes
    ----------
    unused
        Labels between the ones found that belong to no image; means something only if every
        image is asked for.
    """

    def __init__(
        self, track: Track, label: LabelTopic, images: Track, selection: Selection
    ) -> None:
        self.track = track
        self.unused = 0
        self._images = images
        self._label = label
        self._last: int | None = None
        clocks = _clocks(images, track, selection.clock)
        self._pairing = Pairing(*clocks, selection.tolerance_ns)

    def of(self, image: int) -> Label | None:
        """Find the label of the image at a position."""
        if self._last is None:
            logged = self._images.log_times[image]
            self._pairing.begin_near(int(np.searchsorted(self.track.log_times, logged)))
        position = self._pairing.partner(image)
        if position is None:
            return None
        if self._last is not None:
            self.unused += max(position - self._last - 1, 0)
        self._last = position
        return Label(read_or_error(self.track, position), self._label.labels, self.track.name)


def read_or_error(track: Pictures, position: int) -> Picture | FrameError:
    """Read a picture, or say why it cannot be."""
    try:
        return track.picture(position)
    except FrameError as error:
        return error
