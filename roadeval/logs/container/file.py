"""The table of contents of one MCAP file: its channels, and where their messages lie."""

from __future__ import annotations

import zlib
from array import array
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from roadeval.logs.container.chunks import BIG, ChunkReader
from roadeval.logs.container.readers import Buffer, ByteReader, FileReader
from roadeval.logs.container.records import (
    MESSAGE_HEAD,
    Chunk,
    Entries,
    Message,
    message_at,
    parse,
    walk,
)
from roadeval.logs.container.scan import IsWhole, Scan
from roadeval.logs.container.summary import read_summary, statistics_after
from roadeval.logs.errors import BadRecord

BLOCK: Final = 1 << 20
"""Bytes to take at a time of a whole file."""
OUTSIDE: Final = -1
"""The chunk number of a message that lies in no chunk."""


@dataclass(slots=True)
class ChannelLog:
    """Where the messages of one channel lie.

    ``blocks`` holds chunk numbers and entries in the order of the file; it stays empty for a
    channel that is not wanted, of which only count and time range are kept.
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
    """One MCAP file, damaged or not.

    Parameters
    ----------
    path
        The file.
    wanted
        Whether the messages of a channel, with its schema, will be read.
    is_whole
        Whether a message, with its channel and schema, is of the right length; called only next
        to damage.
    keep_corrupt
        Whether to read data whose checksum is wrong.

    Attributes
    ----------
    schemas, channels
        By their numbers.
    logs
        Where messages lie, by the number of their channel.
    summary, scan, reader
        The summary at the file's end, what the walk found, and the reader of the chunks.
    misled
        Chunks whose message indexes were found to be wrong.
    redefined
        Offsets of the chunks that define schemas or channels in another way than the summary.
    saved_ns
        Log time of the last message saved from a chunk that is cut off.
    data_is_right
        Whether the checksum of all data is, None before it was looked at.
    """

    def __init__(
        self,
        path: Path,
        wanted: Callable[[Channel, Schema | None], bool],
        is_whole: IsWhole,
        *,
        keep_corrupt: bool = False,
    ) -> None:
        self.path = path
        self.source = FileReader(path)
        self._wanted = wanted
        self.reader = ChunkReader(self.source, keep_corrupt=keep_corrupt)
        self.summary = read_summary(self.source)
        self.scan = Scan(self.source, self.summary, is_whole)
        if self.summary.problem and self.scan.after_data is not None:
            found = statistics_after(self.source, self.scan.after_data)
            self.summary = replace(self.summary, statistics=found)
        self.schemas, self.channels = self.scan.schemas, self.scan.channels
        self.data_is_right: bool | None = None
        self.saved_ns: int | None = None
        self.misled: set[int] = set()
        self.redefined: set[int] = set()
        self.logs = self._collect()

    @property
    def chunks(self) -> list[Chunk]:
        """The chunks, in the order of the file."""
        return self.scan.chunks

    @property
    def expected(self) -> Mapping[int, int]:
        """How many messages a channel should have, by the file's own statistics, if any."""
        statistics = self.summary.statistics
        return statistics.channel_message_counts if statistics else {}

    def topic(self, channel_id: int) -> str:
        """Return the topic of a channel, or its number where it is not defined."""
        channel = self.channels.get(channel_id)
        return channel.topic if channel else f"channel {channel_id}"

    def message(self, chunk: int, offset: int) -> Message:
        """Read the message at ``offset`` in a chunk, or in the file if it is `OUTSIDE`.

        Raises
        ------
        BadRecord
            If it cannot be read, or its chunk cannot.
        """
        if chunk == OUTSIDE:
            return message_at(self.source, offset)
        return message_at(self.reader.read(self.chunks[chunk]), offset)

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
        return chunk != OUTSIDE and self.chunks[chunk].offset in self.reader.bad

    def verify(self) -> None:
        """Read everything once, so that all damage is known."""
        for chunk in self.chunks:
            if chunk.offset not in self.reader.whole:
                with suppress(BadRecord):
                    self.reader.read(chunk)
        self.verify_data()

    def read_all(self, take: Callable[[bytes], object]) -> None:
        """Pass the whole file to ``take`` in blocks, and check the checksum of all data."""
        crc, end = 0, self.scan.data_end or 0
        for offset in range(0, self.source.size, BLOCK):
            block = self.source.read(offset, BLOCK)
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

    def _collect(self) -> dict[int, ChannelLog]:
        """File all messages by channel; look into every chunk if the statistics differ."""
        counted = self.summary.statistics is not None
        logs = self._file_all(look=not counted)
        counts = {channel_id: log.count for channel_id, log in logs.items()}
        if counted and counts != {key: count for key, count in self.expected.items() if count}:
            logs = self._file_all(look=True)
        return self._file_all(look=not counted) if self._redefine(logs) else logs

    def _redefine(self, logs: Mapping[int, ChannelLog]) -> bool:
        """Take definitions from the data where the summary has others; return whether it has.

        Messages were written by those in the data, which stand in the first chunk or in that of a
        channel's first message. Only a chunk with a checksum is believed more than the summary.
        """
        first = {0} | {log.blocks[0][0] for log in logs.values() if log.blocks}
        for number in sorted(first - {OUTSIDE}):
            chunk = self.chunks[number] if self.chunks else None
            if chunk is None or chunk.cut or not chunk.crc or chunk.size > BIG:
                continue
            with suppress(BadRecord):
                for record in _definitions(self.reader.read(chunk)):
                    known = self.schemas if isinstance(record, Schema) else self.channels
                    if known.get(record.id, record) != record:
                        known[record.id] = record
                        self.redefined.add(chunk.offset)
        return bool(self.redefined)

    def _file_all(self, *, look: bool) -> dict[int, ChannelLog]:
        logs: dict[int, ChannelLog] = {}
        for number in range(len(self.chunks)):
            for channel_id, entries in self._index(number, look=look).items():
                self._log(logs, channel_id).add(number, entries)
        for channel_id, values in self.scan.loose.items():
            self._log(logs, channel_id).add(OUTSIDE, _entries(values))
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
        found: dict[int, array[int]] = {}
        end = 0
        for place in walk(records):
            end = place.end
            if place.opcode == Opcode.MESSAGE and place.end - place.body >= MESSAGE_HEAD.size:
                head = records.peek(place.body, MESSAGE_HEAD.size)
                channel_id, _, log_time, _ = MESSAGE_HEAD.unpack(head)
                found.setdefault(channel_id, array("Q")).extend((log_time, place.offset))
            elif place.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._define(place.opcode, records.read(place.body, place.end - place.body))
        if end != records.size and not chunk.cut:
            self.reader.kept.setdefault(chunk.offset, "a chunk whose records do not add up")
        if chunk.cut:
            self.saved_ns = max((max(values[::2]) for values in found.values()), default=None)
        return {channel_id: _entries(values) for channel_id, values in found.items()}

    def _define(self, opcode: int, body: Buffer) -> None:
        """Learn a schema or channel; of a damaged one, its messages show that it is missing."""
        with suppress(BadRecord):
            record = parse(opcode, body)
            known = self.schemas if opcode == Opcode.SCHEMA else self.channels
            known.setdefault(record.id, record)

    def _log(self, logs: dict[int, ChannelLog], channel_id: int) -> ChannelLog:
        if channel_id not in logs:
            channel = self.channels.get(channel_id)
            schema = self.schemas.get(channel.schema_id) if channel else None
            logs[channel_id] = ChannelLog(bool(channel and self._wanted(channel, schema)))
        return logs[channel_id]


def _definitions(records: ByteReader) -> Iterator[Any]:
    """Yield the schemas and channels of a chunk."""
    for place in walk(records):
        if place.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            with suppress(BadRecord):
                yield parse(place.opcode, records.read(place.body, place.end - place.body))


def _entries(values: array[int]) -> Entries:
    """``(n, 2)`` of a flat row of log times and offsets."""
    return np.frombuffer(values, np.int64).reshape(-1, 2)
