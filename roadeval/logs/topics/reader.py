"""The messages of one topic, in the order of their log times."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from mcap.records import Channel, Schema

from roadeval.images import Limits
from roadeval.logs.container.file import OUTSIDE, ChannelLog, Container, sure_until
from roadeval.logs.container.records import Message
from roadeval.logs.errors import BadMessage, BadRecord, FrameError
from roadeval.logs.messages.pictures import Decoder, LoggedPicture, decoder_for

UNREADABLE: Final = -(2**63) + 1
"""A stamp that cannot be read."""
UNREAD: Final = UNREADABLE - 1
"""A stamp not read yet."""


@dataclass(frozen=True, slots=True)
class FileChannel:
    """A channel of one file of the log."""

    container: Container
    channel_id: int

    @property
    def channel(self) -> Channel:
        """The channel's record."""
        return self.container.channels[self.channel_id]

    @property
    def schema(self) -> Schema | None:
        """The schema of its messages, if it has one."""
        return self.container.schemas.get(self.channel.schema_id)

    @property
    def log(self) -> ChannelLog:
        """Where its messages lie."""
        return self.container.logs.get(self.channel_id, ChannelLog(wanted=False))


class TopicReader:
    """The messages of one topic, from all files and channels that carry it.

    Reading is for one thread at a time.

    Attributes
    ----------
    name, channels
        The topic, and the channels that carry it.
    limits
        On the images that are decoded of it.
    log_times
        ``(n,)`` int64 nanoseconds, ascending; equal ones in the order of the file.
    """

    def __init__(
        self,
        name: str,
        channels: Sequence[FileChannel],
        limits: Limits,
        files: Sequence[Container],
        *,
        lacks_files: bool,
    ) -> None:
        self.name = name
        self.channels = channels
        self.limits = limits
        # A file that is damaged may have lost the topic itself.
        self._files = files
        self._lacks_files = lacks_files
        rows = [np.empty((0, 4), np.int64)]
        for number, source in enumerate(channels):
            for chunk, entries in source.log.blocks:
                place = np.full((len(entries), 2), (number, chunk), np.int64)
                rows.append(np.hstack([entries, place]))
        table = np.concatenate(rows)
        table = table[np.argsort(table[:, 0], kind="stable")]
        self.log_times: npt.NDArray[np.int64] = np.ascontiguousarray(table[:, 0])
        self._offsets = table[:, 1]
        self._numbers = table[:, 2].astype(np.int16)
        self._chunks = table[:, 3].astype(np.int32)
        # An array of Python's own: each image asks for some thirty stamps, one by one.
        self._stamps = array("q", [UNREAD]) * len(table)

    def __len__(self) -> int:
        return len(self.log_times)

    def message(self, position: int) -> Message:
        """Read a message; a `FrameError` if it cannot be read."""
        message = self._read(position)
        if message is None and int(self._chunks[position]) != OUTSIDE:
            self._correct(position)
            message = self._read(position)
        if message is None:
            raise self._error(position, "no message where the index says")
        return message

    def _read(self, position: int) -> Message | None:
        """Read a message; None if it is not the one that the index lists."""
        source = self.channels[self._numbers[position]]
        chunk, offset = int(self._chunks[position]), int(self._offsets[position])
        try:
            message: Message = source.container.message(chunk, offset)
        except BadRecord as error:
            if source.container.is_bad(chunk):
                raise self._error(position, str(error)) from error
            return None
        same_time = message.log_time == int(self.log_times[position]) % 2**64
        return message if same_time and message.channel_id == source.channel_id else None

    def _correct(self, position: int) -> None:
        """Correct the places of a chunk's messages by looking into the chunk."""
        number, chunk = self._numbers[position], self._chunks[position]
        source = self.channels[number]
        here = np.flatnonzero((self._numbers == number) & (self._chunks == chunk))
        listed = {(int(self.log_times[i]), int(self._offsets[i])): i for i in here}
        found = [tuple(e) for e in source.container.look(int(chunk), source.channel_id).tolist()]
        missed = [entry for entry in found if entry not in listed]
        for wrong, right in zip(sorted(listed.keys() - {*found}), missed, strict=False):
            self.log_times[listed[wrong]], self._offsets[listed[wrong]] = right

    def picture(self, position: int) -> LoggedPicture:
        """Read the picture of a message; a `FrameError` if it cannot be read or decoded."""
        message = self.message(position)
        try:
            return self._decoder(position).picture(message.data)
        except BadMessage as error:
            raise self._error(position, str(error)) from error

    def stamp(self, position: int) -> int:
        """Header stamp of a message in nanoseconds, or `UNREADABLE`."""
        stamp = self._stamps[position]
        if stamp == UNREAD:
            try:
                data = self.message(position).data
                stamp = self._decoder(position).stamp(data)
            except (FrameError, BadMessage):
                stamp = UNREADABLE
            if not UNREADABLE <= stamp < 2**63:  # no time that a table could hold
                stamp = UNREADABLE
            self._stamps[position] = stamp
        return stamp

    def place(self, _position: int) -> str:
        """Return where a message lies, for messages to people."""
        return self.name

    def is_lost(self, position: int) -> bool:
        """Return whether a message lies in a chunk that was found to be unreadable."""
        source = self.channels[self._numbers[position]]
        return bool(source.container.is_bad(int(self._chunks[position])))

    def expected(self) -> int:
        """Return how many messages there should be, by the files' own statistics."""
        return sum(s.container.expected.get(s.channel_id, 0) for s in self.channels)

    @property
    def sure(self) -> int:
        """How many messages, from the first one on, are certain to have their original positions.

        Damage may have taken an unknown number of messages before the others.
        """
        ends = [end for end in map(sure_until, self._files) if end is not None]
        if self._lacks_files:
            return 0
        if not ends:
            return len(self)
        return int(np.searchsorted(self.log_times, min(ends), side="right"))

    def readable(self) -> int:
        """Count the messages of the log, without those in chunks found to be damaged."""
        lost = 0
        for number, source in enumerate(self.channels):
            found = np.unique(self._chunks[self._numbers == number], return_counts=True)
            for chunk, count in zip(*found, strict=True):
                lost += source.container.is_bad(int(chunk)) * int(count)
        return len(self) - lost

    def _decoder(self, position: int) -> Decoder:
        source = self.channels[self._numbers[position]]
        return decoder_for(source.channel, source.schema)

    def _error(self, position: int, reason: str) -> FrameError:
        return FrameError(f"{self.name} message {position}: {reason}")


def topic_readers(
    containers: Sequence[Container], limits: Limits, *, lacks_files: bool
) -> dict[str, TopicReader]:
    """Return a reader for each topic, over the channels that carry it in the files' order.

    ``lacks_files`` says whether there are files of the log that cannot be read at all.
    """
    channels: dict[str, list[FileChannel]] = {}
    for container in containers:
        for channel_id, channel in sorted(container.channels.items()):
            channels.setdefault(channel.topic, []).append(FileChannel(container, channel_id))
    return {
        topic: TopicReader(topic, found, limits, containers, lacks_files=lacks_files)
        for topic, found in channels.items()
    }
