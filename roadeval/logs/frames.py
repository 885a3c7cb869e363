"""The frames of a log, one after the other, in memory that does not grow with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from roadeval.data import IGNORE, Frame, Mask, Rgb, Truth
from roadeval.logs.errors import BadMessage, FrameError
from roadeval.logs.labels import LabelMap
from roadeval.logs.messages import CompressedPicture, Kind, Picture
from roadeval.logs.pairing import Pairing, Stamps
from roadeval.logs.pixels import media_type, to_rgb
from roadeval.logs.selection import Clock, LabelTopic, Selection
from roadeval.logs.span import Span
from roadeval.logs.track import UNREADABLE, Track
from roadeval.logs.video import Pictures, Video


@dataclass(slots=True)
class Accounting:
    """What became of the frames of a log, filled while they are read.

    Parameters
    ----------
    in_log
        Messages of the image topic.
    in_range
        Those inside the span, before its stride and its limit.
    read
        Frames handed out so far.
    labelled
        Of these, the ones with truth.
    undecodable
        Of these, the ones that could not be decoded: number and reason.
    truth_in_log, truth_unused
        Truth messages, and those between the first and last paired one that no image claimed.
    """

    in_log: int = 0
    in_range: int = 0
    read: int = 0
    labelled: int = 0
    undecodable: dict[int, str] = field(default_factory=dict)
    truth_in_log: int = 0
    truth_unused: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class _Label:
    """A label's picture, or why it cannot be read, and how to understand it."""

    picture: Picture | FrameError
    labels: LabelMap
    topic: str


class LoggedFrame:
    """One frame as logged, not decoded yet.

    Attributes
    ----------
    number
        Position in the image topic by log time, from 0, undecodable messages included.
    stamp_ns, log_time_ns
        Header stamp (the log time where the log has no stamps) and log time.
    labelled
        Whether the log has truth for it.
    """

    __slots__ = ("_labels", "_picture", "_report", "_resize", "log_time_ns", "number", "stamp_ns")

    def __init__(
        self,
        number: int,
        stamp_ns: int,
        log_time_ns: int,
        picture: Picture | FrameError,
        labels: Mapping[str, _Label],
        *,
        resize: bool,
        report: Callable[[int, str], None],
    ) -> None:
        self.number = number
        self.stamp_ns = stamp_ns
        self.log_time_ns = log_time_ns
        self._picture = picture
        self._labels = labels
        self._resize = resize
        self._report = report

    @property
    def labelled(self) -> bool:
        """Whether the log has truth for it."""
        return TRUTH in self._labels

    def decode(self) -> Frame:
        """Decode image and labels; can be called from any thread, and mostly frees it.

        Raises
        ------
        FrameError
            If the image or a label of it cannot be decoded.
        """
        try:
            return self._decode()
        except (BadMessage, FrameError) as error:
            reason = f"frame {self.number}: {error}"
            self._report(self.number, str(error))
            raise FrameError(reason) from error

    def _decode(self) -> Frame:
        picture = _readable(self._picture)
        image = to_rgb(picture)
        labels = {name: self._label(label, image) for name, label in self._labels.items()}
        truth, shadow = labels.pop(TRUTH, None), labels.pop(SHADOW, None)
        media = media_type(picture.data) if isinstance(picture, CompressedPicture) else None
        return Frame(
            self.number,
            self.stamp_ns,
            self.log_time_ns,
            image,
            picture.data,
            media,
            truth,
            shadow,
            {name: _as_mask(mask) for name, mask in labels.items()},
        )

    def _label(self, label: _Label, image: Rgb) -> Truth:
        try:
            truth = label.labels.read(_readable(label.picture))
        except BadMessage as error:
            raise FrameError(f"{label.topic}: {error}") from error
        return self._fitted(truth, image, label.topic)

    def _fitted(self, truth: Truth, image: Rgb, topic: str) -> Truth:
        height, width = image.shape[:2]
        if truth.shape == (height, width):
            return truth
        if not self._resize:
            size = f"{truth.shape[1]}x{truth.shape[0]}"
            raise FrameError(f"{topic} is {size}, its image {width}x{height}: see --resize-truth")
        import cv2

        scaled = cv2.resize(truth, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
        return np.asarray(scaled, np.uint8)


TRUTH = "/truth"
SHADOW = "/shadow"
"""Keys among a frame's labels; no mask's name begins with a slash."""


class FrameStream:
    """The frames of a selection, in the order of their log times.

    Attributes
    ----------
    accounting
        What became of the frames, up to date at any moment.
    """

    def __init__(
        self, tracks: Mapping[str, Track], selection: Selection, span: Span, numbers: range
    ) -> None:
        self._images = tracks[selection.image.name]
        self._pictures: Pictures = self._images
        if selection.image.kind is Kind.VIDEO:
            self._pictures = Video(self._images)
        self._selection = selection
        self._numbers = numbers
        self._labels = self._label_tracks(tracks)
        truth = self._labels.get(TRUTH)
        self.accounting = Accounting(
            in_log=len(self._images),
            in_range=len(numbers),
            truth_in_log=len(truth.track) if truth else 0,
        )
        self._span = span
        self._iterator = self._run()

    def __iter__(self) -> Iterator[LoggedFrame]:
        return self

    def __next__(self) -> LoggedFrame:
        return next(self._iterator)

    def __len__(self) -> int:
        taken = len(self._numbers[:: self._span.every])
        return min(taken, self._span.max_frames or taken)

    def _run(self) -> Iterator[LoggedFrame]:
        for number in self._numbers[:: self._span.every][: len(self)]:
            yield self._frame(number)

    def _frame(self, number: int) -> LoggedFrame:
        labels = {
            name: found for name, track in self._labels.items() if (found := track.of(number))
        }
        self.accounting.read += 1
        self.accounting.labelled += TRUTH in labels
        if TRUTH in self._labels:
            self.accounting.truth_unused = self._labels[TRUTH].unused
        picture = _read(self._pictures, number)
        log_time = int(self._images.log_times[number])
        return LoggedFrame(
            number,
            self._stamp(number, log_time),
            log_time,
            picture,
            labels,
            resize=self._selection.resize_truth,
            report=self.accounting.undecodable.__setitem__,
        )

    def _stamp(self, number: int, log_time: int) -> int:
        stamped = self._selection.clock is Clock.STAMP
        stamp = self._images.stamp(number) if stamped else UNREADABLE
        return log_time if stamp == UNREADABLE else stamp

    def _label_tracks(self, tracks: Mapping[str, Track]) -> dict[str, _LabelTrack]:
        chosen = {TRUTH: self._selection.truth, SHADOW: self._selection.shadow}
        chosen |= self._selection.masks
        return {
            name: _LabelTrack(tracks[label.topic.name], label, self._images, self._selection)
            for name, label in chosen.items()
            if label is not None
        }


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


class _LabelTrack:
    """The labels of one topic, each found by its image's position."""

    def __init__(
        self, track: Track, label: LabelTopic, images: Track, selection: Selection
    ) -> None:
        self.track = track
        self.unused = 0
        self._label = label
        self._last: int | None = None
        clocks = _clocks(images, track, selection.clock)
        self._pairing = Pairing(*clocks, selection.tolerance_ns)

    def of(self, image: int) -> _Label | None:
        position = self._pairing.partner(image)
        if position is None:
            return None
        if self._last is not None:
            self.unused += max(position - self._last - 1, 0)
        self._last = position
        return _Label(_read(self.track, position), self._label.labels, self.track.name)


def _read(track: Pictures, position: int) -> Picture | FrameError:
    try:
        return track.picture(position)
    except FrameError as error:
        return error


def _readable(picture: Picture | FrameError) -> Picture:
    if isinstance(picture, FrameError):
        raise picture
    return picture


def _as_mask(truth: npt.NDArray[Any]) -> Mask:
    """Take what a mask leaves open for non-road: a mask has no third value."""
    return np.where(truth == IGNORE, 0, truth).astype(np.uint8)
