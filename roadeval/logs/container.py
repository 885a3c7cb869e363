"""One MCAP file as a table of contents: what is in it and where, in whatever state it is.

The file is walked once from record to record, stepping over the data of chunks: that tells
what is really there. The summary at the end is a second witness.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType

import numpy as np
import numpy.typing as npt
from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics

from roadeval.logs.chunks import ChunkReader
from roadeval.logs.records import (
    CHUNK_HEAD,
    HEAD,
    LONGEST_NAME,
    MAGIC,
    MESSAGE_HEAD,
    BadRecord,
    Chunk,
    Message,
    Place,
    message_at,
    parse,
    parse_chunk,
    parse_message_index,
    walk,
)
from roadeval.logs.source import Source

Int64s = npt.NDArray[np.int64]
OUTSIDE = -1
"""The chunk number of a message that lies in no chunk."""
SMALL = 64 << 20
"""No record but a chunk, a message or an attachment is larger."""


@dataclass(frozen=True, slots=True)
class Damage:
    """A part of a file that could not be read.

    ``offset`` is the byte where it begins; ``start_ns`` and ``end_ns`` are the log times between
    which messages are lost, None where nothing tells.
    """

    path: Path
    offset: int
    reason: str
    start_ns: int | None = None
    end_ns: int | None = None

    def __str__(self) -> str:
        return f"{self.path.name}: {self.reason} at byte {self.offset}"


@dataclass(slots=True)
class ChannelLog:
    """Where the messages of one channel lie, as the walk finds them.

    ``blocks`` holds (chunk number, ``(n, 2)`` log times and offsets) in file order; it stays
    empty for a channel nobody asked for, of which only count and time range are kept.
    """

    wanted: bool
    count: int = 0
    first_ns: int = np.iinfo(np.int64).max
    last_ns: int = np.iinfo(np.int64).min
    blocks: list[tuple[int, Int64s]] = field(default_factory=list)

    def add(self, chunk: int, entries: Int64s) -> None:
        """Add ``(n, 2)`` log times and offsets of messages in a chunk."""
        if not len(entries):
            return
        self.count += len(entries)
        self.first_ns = min(self.first_ns, int(entries[:, 0].min()))
        self.last_ns = max(self.last_ns, int(entries[:, 0].max()))
        if self.wanted:
            self.blocks.append((chunk, entries))


class Container:
    """One MCAP file.

    Parameters
    ----------
    path
        The file.
    wanted
        Tells, by a channel and its schema, whether its messages will be read.
    keep_corrupt
        Whether to read chunks whose checksum is wrong.
    """

    def __init__(
        self,
        path: Path,
        wanted: Callable[[Channel, Schema | None], bool],
        *,
        keep_corrupt: bool = False,
    ) -> None:
        self.path = path
        self.source = Source(path)
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.chunks: list[Chunk] = []
        self.logs: dict[int, ChannelLog] = {}
        self.statistics: Statistics | None = None
        self.damage: list[Damage] = []
        self._wanted = wanted
        self._reader = ChunkReader(self.source, keep_corrupt=keep_corrupt)
        self._loose: dict[int, array[int]] = {}
        self._indexes: dict[int, Int64s] = {}
        self._closed = -1
        self._read_summary()
        self._walk()

    def message(self, chunk: int, offset: int) -> Message:
        """Read the message at ``offset`` in a chunk, or in the file if it is `OUTSIDE`.

        Raises
        ------
        BadRecord
            If it cannot be read, or its chunk cannot.
        """
        if chunk != OUTSIDE:
            return message_at(self._reader.read(self.chunks[chunk]), offset)
        _, length = HEAD.unpack(self.source.read(offset, HEAD.size))
        return message_at(self.source.read(offset, HEAD.size + length), 0)

    def close(self) -> None:
        """Close the file."""
        self.source.close()

    def __enter__(self) -> Container:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _read_summary(self) -> None:
        """Learn channels, schemas and statistics from the end of the file, if it has one."""
        footer_size = HEAD.size + 20 + len(MAGIC)
        tail = self.source.read(max(self.source.size - footer_size, 0), footer_size)
        if len(tail) < footer_size or not tail.endswith(MAGIC) or tail[0] != Opcode.FOOTER:
            return
        start = parse(Opcode.FOOTER, tail[HEAD.size : -len(MAGIC)]).summary_start
        if not 0 < start < self.source.size - footer_size:
            return
        summary = self.source.read(start, self.source.size - footer_size - start)
        try:
            for place in walk(summary):
                if place.opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS):
                    self._define(place.opcode, summary[place.body : place.end])
        except BadRecord as error:
            self.damage.append(Damage(self.path, start, str(error)))

    def _define(self, opcode: int, body: bytes | memoryview) -> None:
        record = parse(opcode, body)
        if isinstance(record, Schema):
            self.schemas.setdefault(record.id, record)
        elif isinstance(record, Channel):
            self.channels.setdefault(record.id, record)
        elif isinstance(record, Statistics):
            self.statistics = record

    def _walk(self) -> None:
        """Go from record to record through the data section."""
        offset = len(MAGIC)
        try:
            while offset < self.source.size:
                place = self._place(offset)
                if place.opcode != Opcode.MESSAGE_INDEX:
                    self._close_chunk()
                if place.opcode in (Opcode.DATA_END, Opcode.FOOTER):
                    break
                self._visit(place)
                offset = place.end
        except BadRecord as error:
            self.damage.append(Damage(self.path, offset, str(error)))
        self._close_chunk()
        for channel_id, entries in self._loose.items():
            self._log(channel_id).add(OUTSIDE, _pairs(entries))

    def _place(self, offset: int) -> Place:
        head = self.source.peek(offset, HEAD.size)
        if len(head) < HEAD.size:
            raise BadRecord("the file is cut off")
        opcode, length = HEAD.unpack(head)
        end = offset + HEAD.size + length
        if end > self.source.size:
            raise BadRecord("the file is cut off")
        return Place(opcode, offset, offset + HEAD.size, end)

    def _visit(self, place: Place) -> None:
        if place.opcode == Opcode.MESSAGE:
            head = self.source.peek(place.body, MESSAGE_HEAD.size)
            channel_id, _, log_time, _ = MESSAGE_HEAD.unpack(head)
            self._loose.setdefault(channel_id, array("Q")).extend((log_time, place.offset))
        elif place.opcode == Opcode.CHUNK:
            length = min(place.end - place.body, CHUNK_HEAD.size + LONGEST_NAME + 8)
            self.chunks.append(parse_chunk(place, self.source.peek(place.body, length)))
        elif place.opcode == Opcode.MESSAGE_INDEX:
            body = bytes(self.source.peek(place.body, place.end - place.body))
            channel_id, entries = parse_message_index(body)
            self._indexes[channel_id] = entries
        elif place.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._define(place.opcode, self.source.peek(place.body, place.end - place.body))

    def _close_chunk(self) -> None:
        """File the message indexes that followed a chunk, or make them from its records."""
        if not self.chunks or self.chunks[-1].offset == self._closed:
            return
        self._closed = self.chunks[-1].offset
        number = len(self.chunks) - 1
        known = all(channel_id in self.channels for channel_id in self._indexes)
        if not self._indexes or not known:
            self._indexes = self._index(number)
        for channel_id, entries in self._indexes.items():
            self._log(channel_id).add(number, entries)
        self._indexes = {}

    def _index(self, number: int) -> dict[int, Int64s]:
        """Read a chunk to learn its channels and where its messages lie."""
        found: dict[int, array[int]] = {}
        chunk = self.chunks[number]
        try:
            records = self._reader.read(chunk)
            for place in walk(records):
                if place.opcode == Opcode.MESSAGE:
                    message = message_at(records, place.offset)
                    entries = found.setdefault(message.channel_id, array("Q"))
                    entries.extend((message.log_time, place.offset))
                elif place.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._define(place.opcode, records[place.body : place.end])
        except BadRecord as error:
            damage = Damage(self.path, chunk.offset, str(error), chunk.start, chunk.end)
            self.damage.append(damage)
        return {key: _pairs(value) for key, value in found.items()}

    def _log(self, channel_id: int) -> ChannelLog:
        if channel_id not in self.logs:
            channel = self.channels.get(channel_id)
            schema = self.schemas.get(channel.schema_id) if channel else None
            self.logs[channel_id] = ChannelLog(bool(channel and self._wanted(channel, schema)))
        return self.logs[channel_id]


def _pairs(values: array[int]) -> Int64s:
    """``(n, 2)`` of a flat row of log times and offsets."""
    return np.frombuffer(values, np.int64).reshape(-1, 2)
