"""The stream of a log's frames, in memory that does not grow with the log's length."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping
from functools import cached_property

import numpy as np

from roadeval.logs.accounting import Accounting
from roadeval.logs.logged_frame import SHADOW, TRUTH, FrameRules, LoggedFrame
from roadeval.logs.messages.schemas import TopicKind
from roadeval.logs.messages.video import PictureSequence, Video
from roadeval.logs.span import Span
from roadeval.logs.topics.label_reader import LabelReader, clocks_of, read_or_error
from roadeval.logs.topics.pairing import UNREADABLE
from roadeval.logs.topics.reader import TopicReader
from roadeval.logs.topics.selection import Clock, Selection
from roadeval.logs.topics.survey import repeats, tell_fringes, tell_repeats, tell_sizes


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
            self._pictures = Video(self._images, self._images.limits)
        self._selection = selection
        self._numbers = numbers
        self._labels = self._label_readers(readers)
        self.accounting = Accounting(in_log=len(self._images), in_range=len(numbers))
        self._span = span
        self._rules = FrameRules(
            limits=self._images.limits,
            size=selection.image.size,
            resize=selection.resize_truth,
            scale=selection.scale,
        )
        self._stamps = array("q")
        self._iterator = self._run()

    def __iter__(self) -> Iterator[LoggedFrame]:
        return self

    def __next__(self) -> LoggedFrame:
        return next(self._iterator)

    def __len__(self) -> int:
        return len(self._taken)

    @cached_property
    def oddities(self) -> tuple[str, ...]:
        """What a user should know of the frames that were read, a sentence each.

        Ask for it after the last frame was decoded.
        """
        read, size = len(self._stamps), self._selection.image.size
        numbers = self._taken[:read]
        repeated = repeats(self._images, numbers, np.array(self._stamps, np.int64))
        return (
            *tell_sizes(self.accounting.sizes, read, size),
            *tell_repeats(repeated, read),
            *tell_fringes(self.accounting.fringes),
        )

    @property
    def _taken(self) -> range:
        taken = self._numbers[:: self._span.every]
        return taken[: self._span.max_frames or len(taken)]

    def _run(self) -> Iterator[LoggedFrame]:
        for number in self._taken:
            yield self._frame(number)

    def _frame(self, number: int) -> LoggedFrame:
        labels = {
            name: found for name, reader in self._labels.items() if (found := reader.of(number))
        }
        self.accounting.read += 1
        self.accounting.labelled += TRUTH in labels
        self.accounting.masks.update(labels.keys() - {TRUTH, SHADOW})
        if TRUTH in self._labels and self._span.every == 1:
            self.accounting.truth_unused = self._labels[TRUTH].unused
        # Reading a message corrects its log time where the file's index is wrong.
        picture = read_or_error(self._pictures, number)
        log_time = int(self._images.log_times[number])
        self._stamps.append(self._stamp(number, log_time))
        return LoggedFrame(
            number=number,
            stamp_ns=self._stamps[-1],
            log_time_ns=log_time,
            picture=picture,
            labels=labels,
            rules=self._rules,
            accounting=self.accounting,
        )

    def _stamp(self, number: int, log_time: int) -> int:
        stamped = self._selection.clock is Clock.STAMP
        stamp = self._images.stamp(number) if stamped else UNREADABLE
        return log_time if stamp == UNREADABLE else stamp

    def _label_readers(self, readers: Mapping[str, TopicReader]) -> dict[str, LabelReader]:
        selection, images = self._selection, self._images
        chosen = {TRUTH: selection.truth, SHADOW: selection.shadow, **selection.masks}
        found = {}
        for name, label in chosen.items():
            if label is not None:
                reader = readers[label.topic.name]
                clocks = clocks_of(images, reader, selection.clock)
                found[name] = LabelReader(
                    reader, label.labels, images, clocks, selection.tolerance_ns
                )
        return found | {name: each.reader(images) for name, each in selection.elsewhere.items()}
