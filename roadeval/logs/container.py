"""One MCAP file as a table of contents: what is in it, where, and what of it is lost."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from roadeval.logs.chunks import ChunkReader, crc_of
from roadeval.logs.damage import Damage
from roadeval.logs.errors import BadRecord
from roadeval.logs.records import (
    MESSAGE_HEAD,
    Chunk,
    Entries,
    Message,
    message_at,
    parse,
    walk,
)
from roadeval.logs.scan import Gap, Scan
from roadeval.logs.source import Source
from roadeval.logs.summary import read_summary

OUTSIDE: Final = -1
"""The chunk number of a message that lies in no chunk."""


@dataclass(slots=True)
class ChannelLog:
    """Where the messages of one channel lie.

    ``blocks`` holds chunk numbers and entries in the order of the file; it stays empty for a
    channel that nobody will read, of which only count and time range are kept.
    """

    wanted: bool
    count: int = 0
    first_ns: int = np.iinfo(np.int64).max
    last_ns: int = np.iinfo(np.int64).min
    blocks: list[tuple[int, Entries]] = field(default_factory=list)

    def add(self, chunk: int, entries: Entries) -> None:
        """Add the messages of a chunk."""
        if not len(entries):
            return
        self.count += len(entries)
        self.first_ns = min(self.first_ns, int(entries[:, 0].min()))
        self.last_ns = max(self.last_ns, int(entries[:, 0].max()))
        if self.wanted:
            self.blocks.append((chunk, entries))


class Container:
    """One MCAP file, in whatever state it is.

    Parameters
    ----------
    path
        The file.
    wanted
        Tells, by a channel and its schema, whether its messages will be read.
    is_whole
        Tells, by a channel, its schema and a message, whether the message is of the right
        length; asked only beside damage.
    keep_corrupt
        Whether to read data whose checksum is wrong.

    Attributes
    ----------
    schemas, channels
        By their numbers.
    logs
        Where messages lie, by the number of their channel.
    misled
        Chunks whose message indexes were found to be wrong.
    """

    def __init__(
        self,
        path: Path,
        wanted: Callable[[Channel, Schema | None], bool],
        is_whole: Callable[[Channel, Schema | None, Message], bool],
        *,
        keep_corrupt: bool = False,
    ) -> None:
        self.path = path
        self.source = Source(path)
        self._wanted = wanted
        self._reader = ChunkReader(self.source, keep_corrupt=keep_corrupt)
        self._summary = read_summary(self.source)

        def whole(scan: Scan, message: Message) -> bool:
            channel = scan.channels.get(message.channel_id)
            return channel is not None and is_whole(
                channel, scan.schemas.get(channel.schema_id), message
            )

        self._scan = Scan(self.source, self._summary, whole)
        self.schemas, self.channels = self._scan.schemas, self._scan.channels
        statistics = self._summary.statistics
        self._expected = statistics.channel_message_counts if statistics else None
        self._data_is_wrong = False
        self._saved_ns: int | None = None
        self.misled: set[int] = set()
        self.logs = self._collect()

    @property
    def chunks(self) -> list[Chunk]:
        """The chunks, in the order of the file."""
        return self._scan.chunks

    def expected_of(self, topic: str) -> int | None:
        """How many messages of a topic there should be, by the file's own statistics."""
        if self._expected is None:
            return None
        channels = [number for number, channel in self.channels.items() if channel.topic == topic]
        return sum(self._expected.get(number, 0) for number in channels)

    def message(self, chunk: int, offset: int) -> Message:
        """Read the message at ``offset`` in a chunk, or in the file if it is `OUTSIDE`.

        Raises
        ------
        BadRecord
            If it cannot be read, or its chunk cannot.
        """
        if chunk == OUTSIDE:
            return message_at(self.source, offset)
        return message_at(self._reader.read(self.chunks[chunk]), offset)

    def look(self, chunk: int, channel_id: int) -> Entries:
        """Find the messages of a channel by looking into a chunk, whatever its indexes say.

        Raises
        ------
        BadRecord
            If the chunk cannot be read.
        """
        self.misled.add(chunk)
        return self._look(chunk).get(channel_id, _entries(array("Q")))

    def is_bad(self, chunk: int) -> bool:
        """Whether a chunk was found to be unreadable."""
        return chunk != OUTSIDE and self.chunks[chunk].offset in self._reader.bad

    def verify(self) -> None:
        """Read everything once, so that `damage` knows it all."""
        for chunk in self.chunks:
            try:
                self._reader.read(chunk)
            except BadRecord:
                continue
        self.verify_data()

    def verify_data(self) -> None:
        """Check the checksum of the whole data section, where the file has one."""
        scan = self._scan
        if scan.data_crc and scan.data_end is not None:
            self._data_is_wrong = crc_of(self.source, scan.data_end) != scan.data_crc

    def close(self) -> None:
        """Close the file."""
        self.source.close()

    def _collect(self) -> dict[int, ChannelLog]:
        """File all messages by channel; look into every chunk if the statistics differ."""
        logs = self._file_all(look=self._expected is None)
        counts = {channel_id: log.count for channel_id, log in logs.items()}
        expected = {key: count for key, count in (self._expected or {}).items() if count}
        if self._expected is not None and counts != expected:
            logs = self._file_all(look=True)
        return logs

    def _file_all(self, *, look: bool) -> dict[int, ChannelLog]:
        logs: dict[int, ChannelLog] = {}
        for number in range(len(self.chunks)):
            for channel_id, entries in self._index(number, look=look).items():
                self._log(logs, channel_id).add(number, entries)
        for channel_id, values in self._scan.loose.items():
            self._log(logs, channel_id).add(OUTSIDE, _entries(values))
        return logs

    def _index(self, number: int, *, look: bool) -> Mapping[int, Entries]:
        """Messages of a chunk by channel, by its message indexes or by looking into it."""
        index = self._scan.indexes[number]
        if index and not look and all(self._is_defined(channel_id) for channel_id in index):
            return index
        try:
            return self._look(number)
        except BadRecord:
            return index or {}

    def _is_defined(self, channel_id: int) -> bool:
        channel = self.channels.get(channel_id)
        return channel is not None and (channel.schema_id == 0 or channel.schema_id in self.schemas)

    def _look(self, number: int) -> Mapping[int, Entries]:
        """Walk through the records of a chunk; learn its channels and where its messages lie."""
        records = self._reader.read(self.chunks[number])
        found: dict[int, array[int]] = {}
        for place in walk(records):
            if place.opcode == Opcode.MESSAGE and place.end - place.body >= MESSAGE_HEAD.size:
                head = records.peek(place.body, MESSAGE_HEAD.size)
                channel_id, _, log_time, _ = MESSAGE_HEAD.unpack(head)
                found.setdefault(channel_id, array("Q")).extend((log_time, place.offset))
            elif place.opcode == Opcode.SCHEMA:
                schema = parse(place.opcode, records.read(place.body, place.end - place.body))
                self.schemas.setdefault(schema.id, schema)
            elif place.opcode == Opcode.CHANNEL:
                channel = parse(place.opcode, records.read(place.body, place.end - place.body))
                self.channels.setdefault(channel.id, channel)
        if self.chunks[number].cut:
            self._saved_ns = max((max(values[::2]) for values in found.values()), default=None)
        return {channel_id: _entries(values) for channel_id, values in found.items()}

    def _log(self, logs: dict[int, ChannelLog], channel_id: int) -> ChannelLog:
        if channel_id not in logs:
            channel = self.channels.get(channel_id)
            schema = self.schemas.get(channel.schema_id) if channel else None
            logs[channel_id] = ChannelLog(bool(channel and self._wanted(channel, schema)))
        return logs[channel_id]

    @property
    def damage(self) -> tuple[Damage, ...]:
        """What is wrong with the file, as far as it is known by now, in its order."""
        found = [
            *self._gaps(),
            *self._bad_chunks(),
            *self._wrong_indexes(),
            *self._missing(),
            *self._unnamed(),
            *self._wrong_sums(),
        ]
        return tuple(sorted(found, key=lambda damage: damage.offset))

    def _gaps(self) -> Iterator[Damage]:
        for gap in self._scan.gaps:
            if gap.offset in self._reader.bad and not gap.lossy:
                continue
            before = self._saved_ns if self._is_cut(gap) and self._saved_ns else gap.before_ns
            yield Damage(self.path, gap.offset, gap.reason, gap.lossy, before, gap.after_ns)

    def _is_cut(self, gap: Gap) -> bool:
        return bool(self.chunks) and self.chunks[-1].cut and gap.offset == self.chunks[-1].offset

    def _bad_chunks(self) -> Iterator[Damage]:
        for number, chunk in enumerate(self.chunks):
            if chunk.offset in self._reader.bad:
                index = self._scan.indexes[number] or {}
                lost = tuple((self._topic(key), len(entries)) for key, entries in index.items())
                reason = self._reader.bad[chunk.offset]
                yield Damage(self.path, chunk.offset, reason, True, chunk.start, chunk.end, lost)

    def _wrong_indexes(self) -> Iterator[Damage]:
        for number in self.misled:
            reason = "the message index of a chunk is wrong"
            yield Damage(self.path, self.chunks[number].offset, reason, lossy=False)

    def _missing(self) -> Iterator[Damage]:
        """Messages that the file's own statistics count, if nothing else explains the loss."""
        if any(gap.lossy for gap in self._scan.gaps) or self._reader.bad:
            return
        for channel_id, expected in (self._expected or {}).items():
            found = self.logs[channel_id].count if channel_id in self.logs else 0
            if found < expected:
                lost = ((self._topic(channel_id), expected - found),)
                reason = "messages that the file's own statistics count are missing"
                yield Damage(self.path, self.source.size, reason, lost=lost)

    def _unnamed(self) -> Iterator[Damage]:
        for channel_id, log in self.logs.items():
            if channel_id not in self.channels:
                reason = f"{log.count} messages of a channel {channel_id} that is defined nowhere"
                yield Damage(self.path, 0, reason, True, log.first_ns, log.last_ns)

    def _wrong_sums(self) -> Iterator[Damage]:
        scan = self._scan
        if scan.data_end is not None and self._summary.problem:
            yield Damage(self.path, scan.data_end, self._summary.problem, lossy=False)
        if self._data_is_wrong:
            unchecked = bool(scan.loose) or not all(chunk.crc for chunk in self.chunks)
            reason = "the checksum of all data is wrong"
            if unchecked:
                reason += ", and nothing tells which message is; any may be"
            yield Damage(self.path, scan.data_end or 0, reason, lossy=unchecked)

    def _topic(self, channel_id: int) -> str:
        channel = self.channels.get(channel_id)
        return channel.topic if channel else f"channel {channel_id}"


def _entries(values: array[int]) -> Entries:
    """``(n, 2)`` of a flat row of log times and offsets."""
    return np.frombuffer(values, np.int64).reshape(-1, 2)
