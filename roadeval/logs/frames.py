"""The stream of a log's frames, in memory that does not grow with the log's length."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from roadeval.logs.logged_frame import SHADOW, TRUTH, LoggedFrame
from roadeval.logs.messages.schemas import TopicKind
from roadeval.logs.messages.video import PictureSequence, Video
from roadeval.logs.span import Span
from roadeval.logs.topics.label_reader import LabelReader, read_or_error
from roadeval.logs.topics.pairing import UNREADABLE
from roadeval.logs.topics.reader import TopicReader
from roadeval.logs.topics.selection import Clock, Selection


@dataclass(slots=True)
class Accounting:
    """Counts of frames and of truth, which grow while frames are read.

    Parameters
    ----------
    in_log
        Messages of the image topic.
    in_range
        Those inside the span, before its stride and its limit.
    read
        Frames returned so far.
    labelled
        Of these, those with truth.
    undecodable
        Of these, those that could not be decoded: number and reason.
    truth_in_log, truth_unused
        Truth messages, and those between the first and last paired one that belong to no image
        (counted only if every frame is read).
    """

    in_log: int = 0
    in_range: int = 0
    read: int = 0
    labelled: int = 0
    undecodable: dict[int, str] = field(default_factory=dict)
    truth_in_log: int = 0
    truth_unused: int = 0


class FrameStream:
    """The frames of a selection, in the order of their log times.

    Attributes
    ----------
    accounting
        Counts of the frames so far.
    """

    def __init__(
        self, readers: Mapping[str, TopicReader], selection: Selection, span: Span, numbers: range
    ) -> None:
        self._images = readers[selection.image.name]
        self._pictures: PictureSequence = self._images
        if selection.image.kind is TopicKind.VIDEO:
            self._pictures = Video(self._images)
        self._selection = selection
        self._numbers = numbers
        self._labels = self._label_readers(readers)
        truth = self._labels.get(TRUTH)
        self.accounting = Accounting(
            in_log=len(self._images),
            in_range=len(numbers),
            truth_in_log=len(truth.reader) if truth else 0,
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
            name: found for name, reader in self._labels.items() if (found := reader.of(number))
        }
        self.accounting.read += 1
        self.accounting.labelled += TRUTH in labels
        if TRUTH in self._labels and self._span.every == 1:
            self.accounting.truth_unused = self._labels[TRUTH].unused
        # Reading a message corrects its log time where the file's index is wrong.
        picture = read_or_error(self._pictures, number)
        log_time = int(self._images.log_times[number])
        return LoggedFrame(
            number=number,
            stamp_ns=self._stamp(number, log_time),
            log_time_ns=log_time,
            picture=picture,
            labels=labels,
            resize=self._selection.resize_truth,
            scale=self._selection.scale,
            report=self.accounting.undecodable.__setitem__,
        )

    def _stamp(self, number: int, log_time: int) -> int:
        stamped = self._selection.clock is Clock.STAMP
        stamp = self._images.stamp(number) if stamped else UNREADABLE
        return log_time if stamp == UNREADABLE else stamp

    def _label_readers(self, readers: Mapping[str, TopicReader]) -> dict[str, LabelReader]:
        chosen = {TRUTH: self._selection.truth, SHADOW: self._selection.shadow}
        chosen |= self._selection.masks
        return {
            name: LabelReader(readers[label.topic.name], label, self._images, self._selection)
            for name, label in chosen.items()
            if label is not None
        }
