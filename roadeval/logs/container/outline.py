"""A remote log described by its summary and first messages, which are cheap to read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Set
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import IO, Final

import numpy as np

from roadeval.logs.container.file import ChannelLog, ChannelTest, Container
from roadeval.logs.container.records import (
    IN_MEMORY,
    MESSAGE_INDEX,
    Chunk,
    Entries,
    FileBytes,
    Summary,
    parse_chunk,
    parse_message_index,
    record_at,
    walk,
)
from roadeval.logs.container.scan import Scan, StampOf
from roadeval.logs.errors import BadRecord

BEGINNING: Final = 192 << 10
"""Least number of uncompressed bytes of a chunk to read: they hold a few frames and labels."""
COMPRESSED_BLOCK: Final = 128 << 10
"""Greatest number of bytes that Zstandard needs before it returns the first byte of a block."""
INDEXES: Final = 4
"""Greatest number of chunks with indexes that are read only for the times of messages."""
MANY: Final = 100
"""Greatest number of messages to read if one is not enough, as of static transforms."""


class SummaryScan(Scan):
    """The beginnings of the chunks that hold the first messages of the topics to be read.

    A `BadRecord` if the summary lacks something, or contradicts what is read of the chunks.
    """

    def __init__(
        self, source: FileBytes, stamp_of: StampOf, is_wanted: ChannelTest, needs_many: ChannelTest
    ) -> None:
        self._is_wanted, self._needs_many = is_wanted, needs_many
        self.totals: dict[int, ChannelLog] = {}
        """Number and times of the messages of the whole log, by channel."""
        super().__init__(source, stamp_of)

    def _walk(self) -> None:
        summary, self.summary = self.summary, Summary()  # reading does not compare with it
        counts, firsts, lasts = _ends_of_channels(summary)
        needed: dict[int, set[int]] = {}
        for number, chunk in firsts.items():
            channel = self.channels.get(number)
            schema = self.schemas.get(channel.schema_id) if channel else None
            if channel is None or (schema is None and channel.schema_id):
                raise BadRecord("a channel that the summary does not describe")
            if self._is_wanted(channel, schema):
                needed.setdefault(chunk.offset, set()).add(number)
        ends = Counter(chunk.offset for chunk in (*firsts.values(), *lasts.values()))
        others = [offset for offset, _ in ends.most_common() if offset not in needed][:INDEXES]
        indexes = {
            offset: self._index_of(summary.chunks[offset], summary.index_ends[offset])
            for offset in (*needed, *others)
        }
        for number, first in firsts.items():
            last = lasts[number]
            begin, end = (indexes.get(chunk.offset, {}).get(number) for chunk in (first, last))
            log = self.totals[number] = ChannelLog(False, counts[number], first.start, last.end)
            if begin is not None:
                log.first_ns = int(begin[:, 0].min())
                if number in needed.get(first.offset, ()):
                    log.times_of_chunk = np.sort(begin[:, 0])
            if end is not None:
                log.last_ns = int(end[:, 0].max())
        for offset, channels in needed.items():
            self._take_beginning(summary.chunks[offset], indexes[offset], channels)

    def _index_of(self, chunk: Chunk, end: int) -> dict[int, Entries]:
        """Return the entries of a chunk's message indexes, which end at ``end``, by channel."""
        if end - chunk.data_end > IN_MEMORY:
            raise BadRecord("a message index of an impossible length")
        data = memoryview(self.source[chunk.data_end : end])
        indexes = dict[int, Entries]()
        for opcode, _, body, after, _ in walk(data):
            if opcode == MESSAGE_INDEX:
                channel_id, entries = parse_message_index(data[body:after])
                times, offsets = entries[:, 0].view("u8"), entries[:, 1].view("u8")
                if len(entries):
                    indexes[channel_id] = entries
                    is_within = chunk.start <= times.min() and times.max() <= chunk.end
                    if not is_within or offsets.max() >= chunk.size:
                        raise BadRecord("a message index that contradicts its chunk")
        return indexes

    def _take_beginning(
        self, listed: Chunk, index: Mapping[int, Entries], channels: Set[int]
    ) -> None:
        """Read a chunk up to the first messages of some channels, or all of it if that fails."""
        if not channels <= index.keys():
            raise BadRecord("a message index that the summary lists is not there")
        starts = np.sort(np.concatenate([entries[:, 1] for entries in index.values()]))
        size = min(BEGINNING, listed.size)
        for number in channels:
            channel = self.channels[number]
            takes_many = self._needs_many(channel, self.schemas.get(channel.schema_id))
            last = np.sort(index[number][:, 1])[:MANY][-1 if takes_many else 0]
            following = starts[np.searchsorted(starts, last, side="right") :]
            size = max(size, int(following[0]) if len(following) else listed.size)
        if listed.compression:
            size = COMPRESSED_BLOCK + int(1.25 * size * listed.data_size / max(listed.size, 1))
        size = min(size, listed.data_size)
        if size > IN_MEMORY:
            raise BadRecord("a chunk with first messages far behind its beginning")
        begin = listed.offset
        head = self.source[begin : listed.data_offset + size]  # one request for head and data
        chunk = parse_chunk(self.source, record_at(self.source, begin))
        if chunk._replace(crc=0) != listed or len(head) < size:
            raise BadRecord("a chunk that the summary lists is not there")
        number = len(self.chunks)
        self.chunks.append(chunk._replace(data_size=size, cut=True))
        self.indexes.append({})
        if size == listed.data_size or not channels <= self.look(number).keys():
            proven = self.reader.proof(chunk)
            if proven is None:
                raise BadRecord("a chunk that is not whole")
            self.chunks[number] = proven
            if not channels <= self.look(number).keys():
                raise BadRecord("a chunk without the messages that its index lists")


def _ends_of_channels(
    summary: Summary,
) -> tuple[Mapping[int, int], dict[int, Chunk], dict[int, Chunk]]:
    """Return each channel's number of messages, and the chunks with its first and its last one.

    A `BadRecord` if the summary does not tell them.
    """
    statistics, chunks = summary.statistics, summary.chunks
    latest = max((max(chunk.start, chunk.end) for chunk in chunks.values()), default=0)
    is_beyond = latest > np.iinfo(np.int64).max
    if summary.problem or not statistics or statistics.chunk_count != len(chunks) or is_beyond:
        raise BadRecord("a summary that does not list all chunks")
    firsts, lasts = dict[int, Chunk](), dict[int, Chunk]()
    for chunk in sorted(chunks.values(), key=lambda chunk: chunk.start):
        for number in summary.channels_in(chunk.offset):
            firsts.setdefault(number, chunk)
            if number not in lasts or lasts[number].end <= chunk.end:
                lasts[number] = chunk
    counts = statistics.channel_message_counts
    if {number for number, count in counts.items() if count} != firsts.keys():
        raise BadRecord("a summary that does not tell where the messages are")
    return counts, firsts, lasts


def outline_of(
    path: Path, file: IO[bytes], is_wanted: ChannelTest, needs_many: ChannelTest, stamp_of: StampOf
) -> Container | None:
    """Open a log by its summary; None if that is missing, damaged, or incomplete.

    Each channel that ``is_wanted`` has only its first message, or up to `MANY` messages of its
    first chunk if it ``needs_many``. Damage of other parts is not noticed.
    """
    with suppress(BadRecord):
        outline = SummaryScan(FileBytes(file), stamp_of, is_wanted, needs_many)
        container = Container(path, outline, is_wanted)
        for channel_id, total in outline.totals.items():
            read = container.logs.get(channel_id)
            container.logs[channel_id] = replace(total, blocks=read.blocks if read else [])
        return container
    return None
