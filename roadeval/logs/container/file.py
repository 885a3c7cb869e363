"""The table of contents of one MCAP log: its channels, and where their messages lie."""

from __future__ import annotations

import zlib
from array import array
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from roadeval.logs.container.chunks import IN_MEMORY, ChunkReader
from roadeval.logs.container.records import (
    HEAD,
    MESSAGE,
    MESSAGE_HEAD,
    PRIVATE,
    Buffer,
    Bytes,
    Chunk,
    Entries,
    FileBytes,
    Message,
    message_at,
    parse,
    walk,
)
from roadeval.logs.container.scan import Scan, StampOf
from roadeval.logs.errors import BadRecord

BLOCK: Final = 1 << 20
"""Bytes to take at a time of a whole file."""
OUTSIDE: Final = -1
"""The chunk number of a message that lies in no chunk."""
RECORDS: Final = 1 << 18
"""Records that chunks may hold beyond one for every few of their bytes: a bomb holds millions."""
BYTES_PER_RECORD: Final = 4
"""Bytes that a message takes at least, however well a chunk is compressed: its times differ."""
CHANNELS: Final = 4096
"""Channels that are read of a log; a robot has hundreds."""
TRIED: Final = 5
"""Chunks with messages by which is told which of two descriptions is right."""
_DEFINITIONS: Final = (Opcode.SCHEMA, Opcode.CHANNEL)

Wanted = Callable[[Channel, Schema | None], bool]
"""Whether the messages of a channel, with its schema, will be read."""


@dataclass(slots=True)
class ChannelLog:
    """Where the messages of one channel lie."""

    wanted: bool
    count: int = 0
    first_ns: int = np.iinfo(np.int64).max
    last_ns: int = np.iinfo(np.int64).min
    blocks: list[tuple[int, Entries]] = field(default_factory=list)
    """Chunk numbers and entries in the order of the file; empty for one that is not wanted."""

    def add(self, chunk: int, entries: Entries) -> None:
        """Add the messages of a chunk."""
        if not len(entries):
            return
        self.count += len(entries)
        self.first_ns = min(self.first_ns, int(entries[:, 0].min()))
        self.last_ns = max(self.last_ns, int(entries[:, 0].max()))
        if self.wanted:
            self.blocks.append((chunk, entries))


def containers_in(
    path: Path, wanted: Wanted, stamp_of: StampOf, *, keep_corrupt: bool = False
) -> Iterator[Container]:
    """Open the log in a file, and those that follow it in the same file.

    Parameters
    ----------
    stamp_of
        Called only next to damage.
    keep_corrupt
        Whether to read data whose checksum is wrong.
    """
    rest = FileBytes(path.open("rb", buffering=0))
    size = len(rest)
    while len(rest) or not size:
        container = Container(path, rest, wanted, stamp_of, keep_corrupt=keep_corrupt)
        yield container
        rest = rest.part(len(container.source), len(rest))
        size = size or 1


class Container:
    """One MCAP log, damaged or not; the parameters are those of `containers_in`."""

    def __init__(
        self,
        path: Path,
        source: FileBytes,
        wanted: Wanted,
        stamp_of: StampOf,
        *,
        keep_corrupt: bool = False,
    ) -> None:
        self.path = path
        self._wanted, self._stamp_of = wanted, stamp_of
        self.source, self.reader = source, ChunkReader(source, keep_corrupt=keep_corrupt)
        self.scan = Scan(source, self.reader, stamp_of)
        if self.scan.next_log is not None:
            self.source = source = source.part(0, self.scan.next_log)
            self.reader = ChunkReader(source, keep_corrupt=keep_corrupt)
            self.scan = Scan(source, self.reader, stamp_of)
        if self.scan.is_shifted:
            self.scan = Scan(source, self.reader, stamp_of, strict=True)
        self.summary = self.scan.summary
        self.schemas, self.channels = self.scan.schemas, self.scan.channels
        self.data_is_right: bool | None = None
        """Whether the checksum of all data is, None before it was looked at."""
        self.saved_ns: int | None = None
        """Log time of the last message saved from a chunk that is cut off."""
        self.misled: set[int] = set()
        """Chunks whose message indexes were found to be wrong."""
        self.unlisted: dict[int, int] = {}
        """Records that the message indexes of a chunk leave out, by the chunk's number."""
        self.redefined: dict[int, str] = {}
        """Which of two descriptions of topics is believed, by the offset of the second."""
        self._records_left = RECORDS
        self._looked: set[int] = set()
        self._confirmed: set[int] = set()
        self.logs = self._collect()
        """Where messages lie, by the number of their channel."""
        read = {channel_id for channel_id, log in self.logs.items() if log.wanted}
        order = sorted(self.channels, key=lambda channel_id: (channel_id not in read, channel_id))
        self.channels_left_out = order[CHANNELS:]
        """Numbers of the channels that are not read, because there are too many."""
        for channel_id in self.channels_left_out:
            del self.channels[channel_id]
            self.logs.pop(channel_id, None)

    @property
    def chunks(self) -> list[Chunk]:
        """The chunks, in the order of the file."""
        return self.scan.chunks

    @property
    def expected(self) -> Mapping[int, int]:
        """How many messages a channel should have, by the file's own statistics, if any."""
        statistics = self.summary.statistics
        return statistics.channel_message_counts if statistics else {}

    @property
    def is_complete(self) -> bool:
        """Whether there are as many messages as a summary counts that can be relied on."""
        return self.summary.checked and self._is_as_counted(self.logs)

    def topic(self, channel_id: int) -> str:
        """Return the topic of a channel, or its number where it is not defined."""
        channel = self.channels.get(channel_id)
        return channel.topic if channel else f"channel {channel_id}"

    def message(self, chunk: int, offset: int) -> Message:
        """Read the message at ``offset`` in a chunk, or in the file if it is `OUTSIDE`."""
        return message_at(self.source if chunk == OUTSIDE else self._records(chunk), offset)

    def look(self, chunk: int, channel_id: int) -> Entries:
        """Find the messages of a channel by looking into a chunk, whatever its indexes say."""
        self.misled.add(chunk)
        return self._look(chunk).get(channel_id, _entries(array("Q")))

    def is_bad(self, chunk: int) -> bool:
        """Whether a chunk was found to be unreadable."""
        return chunk != OUTSIDE and self.chunks[chunk].offset in self.reader.bad

    def verify(self) -> None:
        """Read everything once, so that all damage is known."""
        for number in range(len(self.chunks)):
            if number not in self._confirmed:
                with suppress(BadRecord):
                    self._records(number)
        self.verify_data()

    def read_all(self, take: Callable[[Buffer], object]) -> None:
        """Pass the whole log to ``take`` in blocks, and check the checksum of all data."""
        crc, end = 0, self.scan.data_end or 0
        for offset in range(0, len(self.source), BLOCK):
            block = self.source[offset : offset + BLOCK]
            take(block)
            if self.scan.data_crc and offset < end:
                crc = zlib.crc32(block[: end - offset], crc)
        self.data_is_right = crc == self.scan.data_crc

    def verify_data(self) -> None:
        """Check the checksum of all data, unless that was done or the file has none."""
        if self.data_is_right is None and self.scan.data_crc:
            with suppress(BadRecord):
                self.read_all(len)

    def close(self) -> None:
        """Close the file."""
        self.source.close()

    def _records(self, number: int) -> Bytes:
        """Read a chunk; the first time see whether its message indexes list all that it holds."""
        records = self.reader.read(self.chunks[number])
        if number not in self._confirmed:
            self._confirmed.add(number)
            index = self.scan.indexes[number]
            missing = _unlisted(records, index) if index and number not in self._looked else 0
            if missing:
                self.unlisted[number] = missing
        return records

    def _collect(self) -> dict[int, ChannelLog]:
        """File all messages by channel; look into every chunk if the statistics differ."""
        counted = self.summary.statistics is not None
        found = [self._index(number, look=not counted) for number in range(len(self.chunks))]
        logs = self._file(found)
        if counted and not self._is_as_counted(logs):
            for number in set(range(len(self.chunks))) - self._looked:
                found[number] = self._index(number, look=True)
            logs = self._file(found)
        if logs.keys() - self.channels.keys():
            self._define_by_remains()
            logs = self._file(found)
        return self._file(found) if self._redefine(logs) else logs

    def _is_as_counted(self, logs: Mapping[int, ChannelLog]) -> bool:
        expected = {channel_id: count for channel_id, count in self.expected.items() if count}
        return expected == {channel_id: log.count for channel_id, log in logs.items()}

    def _file(self, found: list[Mapping[int, Entries]]) -> dict[int, ChannelLog]:
        logs: dict[int, ChannelLog] = {}
        outside = {channel_id: _entries(values) for channel_id, values in self.scan.loose.items()}
        for number, index in (*enumerate(found), (OUTSIDE, outside)):
            for channel_id, entries in index.items():
                if channel_id not in logs:
                    channel = self.channels.get(channel_id)
                    schema = self.schemas.get(channel.schema_id) if channel else None
                    logs[channel_id] = ChannelLog(bool(channel and self._wanted(channel, schema)))
                logs[channel_id].add(number, entries)
        return logs

    def _index(self, number: int, *, look: bool) -> Mapping[int, Entries]:
        """Messages of a chunk by channel, by its message indexes or by looking into it."""
        index = self.scan.indexes[number]
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
        chunk = self.chunks[number]
        records = self.reader.read(chunk)
        self._looked.add(number)
        found: dict[int, array[int]] = {}
        end, problem = 0, ""
        usual = chunk.data_size // BYTES_PER_RECORD
        allowed = usual + self._records_left // 2
        for count, (opcode, offset, body, after, _) in enumerate(walk(records)):
            if count == allowed:
                problem = f"a chunk of so many records that only the first {allowed} were read"
                self._records_left -= allowed - usual
                break
            end = after
            if opcode == MESSAGE and after - body >= MESSAGE_HEAD.size:
                head = records[body : body + MESSAGE_HEAD.size]
                channel_id, _, log_time, _ = MESSAGE_HEAD.unpack(head)
                found.setdefault(channel_id, array("Q")).extend((log_time, offset))
            elif opcode in _DEFINITIONS:
                self._define(opcode, records[body:after])
            elif opcode < PRIVATE:
                problem = "a chunk that holds more than messages, which is not read"
        if end != len(records) and not chunk.cut:
            problem = problem or "a chunk whose records do not add up"
        if problem:
            self.reader.kept.setdefault(chunk.offset, problem)
        if chunk.cut:
            self.saved_ns = max((max(values[::2]) for values in found.values()), default=None)
        return {channel_id: _entries(values) for channel_id, values in found.items()}

    def _define(self, opcode: int, body: Buffer) -> None:
        """Learn a schema or channel; of a damaged one, its messages show that it is missing."""
        with suppress(BadRecord):
            record = parse(opcode, body)
            known: dict[int, Any] = self.schemas if opcode == Opcode.SCHEMA else self.channels
            known.setdefault(record.id, record)

    def _define_by_remains(self) -> None:
        """Learn the channels that are described in damaged chunks alone."""
        for chunk in self.chunks:
            if chunk.offset in self.reader.bad:
                records = self.reader.remains(chunk)
                for opcode, _, body, end, _ in islice(walk(records), RECORDS):
                    if opcode in _DEFINITIONS:
                        self._define(opcode, records[body:end])

    def _redefine(self, logs: Mapping[int, ChannelLog]) -> bool:
        """Where a topic is described twice, choose by its messages; return whether any was changed.

        Messages were written by the descriptions in the data, which stand in the first chunk or in
        that of a channel's first message. Only those of a chunk with a checksum are believed where
        the messages do not tell.
        """
        conflicts = [(offset, record, False) for offset, record in self.scan.conflicts]
        first = {0} | {log.blocks[0][0] for log in logs.values() if log.blocks}
        for number in sorted(first - {OUTSIDE}) if self.chunks else []:
            chunk = self.chunks[number]
            if not chunk.cut and chunk.crc and chunk.size <= IN_MEMORY:
                with suppress(BadRecord):
                    found = _definitions(self.reader.read(chunk))
                    conflicts += [(chunk.offset, record, True) for record in found]
        changed = False
        for offset, record, checked in conflicts:
            known: dict[int, Any] = self.schemas if isinstance(record, Schema) else self.channels
            changed |= record.id not in known
            other = known.setdefault(record.id, record)
            if other == record:
                continue
            fit = self._fit(other, logs)
            known[record.id] = record
            own_fit = self._fit(record, logs)
            if own_fit < fit or (own_fit == fit and not checked):
                known[record.id] = other
            changed |= known[record.id] is record
            told, names = "a topic is described here in another way than before", ("that", "this")
            if checked:
                told = "the summary describes topics in another way than the data"
                names = "the summary", "the data"
            name = names[known[record.id] is record]
            doubt = "either may be wrong" if fit == own_fit else "messages fit it better"
            self.redefined[offset] = f"{told}; {name} is believed; {doubt}"
        return changed

    def _fit(self, record: Schema | Channel, logs: Mapping[int, ChannelLog]) -> tuple[int, int]:
        """Count the messages that a description decodes, and sum up how near their stamps are."""
        decoded = nearness = 0
        for channel_id, log in logs.items():
            channel = self.channels.get(channel_id)
            schema = self.schemas.get(channel.schema_id) if channel else None
            if channel is None or record not in (channel, schema):
                continue
            for chunk, entries in log.blocks[:TRIED] if self._wanted(channel, schema) else ():
                log_time, offset = entries[0].tolist()
                with suppress(BadRecord):
                    stamp = self._stamp_of(channel, schema, self.message(chunk, offset))
                    if stamp is not None:
                        decoded, nearness = decoded + 1, nearness - abs(stamp - log_time)
        return decoded, nearness


def _definitions(records: Bytes) -> Iterator[Any]:
    """Yield the schemas and channels of a chunk."""
    for opcode, _, body, end, _ in walk(records):
        if opcode in _DEFINITIONS:
            with suppress(BadRecord):
                yield parse(opcode, records[body:end])


def _unlisted(records: Bytes, index: Mapping[int, Entries]) -> int:
    """Count the records of a chunk that are no definitions and that no message index lists."""
    listed = np.sort(np.concatenate([entries[:, 1] for entries in index.values()]))
    if not isinstance(records, memoryview) or listed[-1] + HEAD.size > len(records):
        return 0
    data = np.frombuffer(records, np.uint8)
    lengths = data[listed[:, None] + np.arange(1, HEAD.size)].view("<i8")[:, 0]
    begins = np.append(0, listed + HEAD.size + lengths)
    ends = np.append(listed, len(records))
    # Between two messages that are not neighbours lie definitions, or what is not listed.
    between = begins < ends
    return sum(
        opcode < PRIVATE and opcode not in _DEFINITIONS
        for begin, end in zip(begins[between].tolist(), ends[between].tolist(), strict=True)
        for opcode, *_ in walk(records[:end], begin)
    )


def _entries(values: array[int]) -> Entries:
    """``(n, 2)`` of a flat row of log times and offsets."""
    return np.frombuffer(values, np.int64).reshape(-1, 2)
