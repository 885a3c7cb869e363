"""The walk from record to record through a file's data section, across damage.

The walk finds what is really there. Chunks are stepped over by the lengths in their own heads or,
where those are damaged, by the lengths in the summary. After a record that makes no sense, the
walk continues at the next one that does.
"""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Final

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from roadeval.logs.container.readers import FileReader
from roadeval.logs.container.records import (
    HEAD,
    INDEX_HEAD,
    LARGEST,
    LONGEST_CHUNK_HEAD,
    MAGIC,
    MESSAGE_HEAD,
    PADDING,
    PRIVATE,
    Chunk,
    Entries,
    Message,
    Place,
    message_at,
    parse,
    parse_message_index,
    place_at,
)
from roadeval.logs.container.recovery.damaged_chunks import by_own_head, by_summary, is_within
from roadeval.logs.container.recovery.next_record import RecordFinder
from roadeval.logs.container.summary import SUMMARY_RECORDS, Summary
from roadeval.logs.errors import BadRecord

_DEFINITIONS: Final = (Opcode.SCHEMA, Opcode.CHANNEL)
_SKIPPED: Final = (Opcode.ATTACHMENT, Opcode.METADATA)
RECENT: Final = 8
"""Messages with whose log times another one's is compared."""

IsWhole = Callable[[Channel, Schema | None, Message], bool]
"""Whether a message, with its channel and schema, is as long as its own fields say."""


@dataclass(slots=True)
class Gap:
    """Bytes that make no sense, to ``end`` (excluded), and the log times around them."""

    offset: int
    end: int
    reason: str
    before_ns: int | None = None
    after_ns: int | None = None
    lossy: bool = True


class Scan:
    """The data section of a file.

    Attributes
    ----------
    chunks
        In the order of the file.
    indexes
        For each chunk, its messages by channel, or None where its message indexes are missing
        or damaged.
    loose
        Log times and offsets, in turn, of the messages outside chunks, by channel.
    schemas, channels
        Those defined outside chunks.
    gaps
        What made no sense.
    data_end, after_data
        Where the data section ends, None if the file ends before; and what comes after it begins.
    data_crc
        Its checksum, 0 if not given.
    """

    def __init__(self, source: FileReader, summary: Summary, is_whole: IsWhole) -> None:
        self.chunks: list[Chunk] = []
        self.indexes: list[dict[int, Entries] | None] = []
        self.loose: dict[int, array[int]] = {}
        self.schemas: dict[int, Schema] = dict(summary.schemas)
        self.channels: dict[int, Channel] = dict(summary.channels)
        self.gaps: list[Gap] = []
        self.data_end: int | None = None
        self.after_data: int | None = None
        self.data_crc = 0
        self._source = source
        self._summary_start = None if summary.problem else summary.start
        self._known = summary.chunks if summary.checked else {}
        self._known_offsets = sorted(self._known)
        self._first_ns, self._final_ns = _time_range(summary)
        self._is_whole = is_whole
        self.recent_ns: deque[int] = deque(maxlen=RECENT)
        self._finder = RecordFinder(source, self.channels, self.recent_ns)
        # The message right before the walk's position, and its channel; None after another record.
        self._last_message: tuple[Place, int] | None = None
        self._run()

    def _run(self) -> None:
        offset = len(MAGIC)
        if self._source.read(0, offset) != MAGIC:
            self._gap(0, offset, "the file does not begin as it should", lossy=False)
        while offset < self._source.size and self.data_end is None:
            if offset == self._summary_start:
                self._gap(offset, offset, "the record that ends the data is missing", lossy=False)
                self.data_end = self.after_data = offset
                break
            try:
                offset = self._visit(self._place(offset))
            except BadRecord as error:
                offset = self._recover(offset, str(error))
        ends_in_gap = any(gap.lossy and gap.end == self._source.size for gap in self.gaps)
        if self.data_end is None and not ends_in_gap:
            size = self._source.size
            self._gap(size, size, "the file was never finished; what came after is not in it")

    def _place(self, offset: int) -> Place:
        index = self._known.get(offset)
        if index is not None:
            return Place(Opcode.CHUNK, offset, offset + HEAD.size, index.end)
        place = place_at(self._source, offset)
        if place.opcode >= PRIVATE and self._finder.begins(place.end):
            return place
        if place.opcode > Opcode.DATA_END or place.opcode == 0:
            raise BadRecord(f"a record of unknown kind {place.opcode}")
        if place.end > self._source.size and place.opcode != Opcode.CHUNK:
            raise BadRecord("a record that goes on beyond the end of the file")
        if place.end > self._next_known(offset):
            raise BadRecord("a record that goes on into the next chunk")
        return place

    def _next_known(self, offset: int) -> float:
        """Where the next chunk begins, by the summary."""
        index = bisect_right(self._known_offsets, offset)
        return self._known_offsets[index] if index < len(self._known_offsets) else inf

    def _visit(self, place: Place) -> int:
        """Take in a record; return where the next one begins."""
        end, message = place.end, None
        if place.opcode == Opcode.MESSAGE:
            message = place, self._message(place)
        elif place.opcode == Opcode.CHUNK:
            end = self._chunk(place)
        elif place.opcode == Opcode.MESSAGE_INDEX:
            self._message_index(place)
        elif place.opcode in _DEFINITIONS:
            self._define(place)
        elif place.opcode == Opcode.DATA_END:
            self._data_end(place)
        elif not self._is_skipped(place):
            raise BadRecord("a record that should not be here")
        self._last_message = message
        return end

    def _message(self, place: Place) -> int:
        """Note where a message outside chunks lies; return its channel."""
        if not MESSAGE_HEAD.size <= place.end - place.body <= LARGEST:
            raise BadRecord("a message of a length that cannot be")
        known = self._known.get(self.chunks[-1].offset) if self.chunks else None
        if known is not None and known.has_index_at(place.offset):
            raise BadRecord("a message where a message index should be")
        head = self._source.peek(place.body, MESSAGE_HEAD.size)
        channel_id, _, log_time, _ = MESSAGE_HEAD.unpack(head)
        if not self._first_ns <= log_time <= self._final_ns:
            raise BadRecord("a message of a time outside the log's")
        self.loose.setdefault(channel_id, array("Q")).extend((log_time, place.offset))
        self._saw(log_time, log_time)
        return int(channel_id)

    def _chunk(self, place: Place) -> int:
        index = self._known.get(place.offset)
        head = bytes(self._source.peek(place.body, LONGEST_CHUNK_HEAD))
        if index is None:
            chunk = by_own_head(place, head, self._source.size, self._finder.is_likely)
        else:
            chunk = by_summary(place, head, index)
            outer = self._source.read(place.offset, HEAD.size)
            if chunk.repaired or outer != HEAD.pack(Opcode.CHUNK, place.end - place.body):
                reason = "the head of a chunk is damaged; the summary tells what it said"
                self._gap(place.offset, place.body, reason, lossy=False)
        end = chunk.data_offset + chunk.data_size
        self.chunks.append(chunk)
        self.indexes.append({})
        if chunk.cut:
            self._gap(place.offset, self._source.size, "the file ends inside a chunk")
        else:
            self._saw(chunk.start, chunk.end)
        return end

    def _message_index(self, place: Place) -> None:
        if place.end - place.body > LARGEST:
            raise BadRecord("a message index of a length that cannot be")
        body = bytes(self._source.peek(place.body, place.end - place.body))
        channel_id, entries = parse_message_index(body)
        if entries.nbytes + INDEX_HEAD.size != len(body) and not self._finder.begins(place.end):
            raise BadRecord("a message index of the wrong length")
        index = self.indexes[-1] if self.indexes else None
        if index is None:
            return
        if channel_id in index or not is_within(entries, self.chunks[-1]):
            self.indexes[-1] = None
        else:
            index[channel_id] = entries

    def _define(self, place: Place) -> None:
        if place.end - place.body > LARGEST:
            raise BadRecord("a definition of a length that cannot be")
        record = parse(place.opcode, self._source.peek(place.body, place.end - place.body))
        if not self._finder.begins(place.end):
            raise BadRecord("a definition of the wrong length")
        known = self.schemas if isinstance(record, Schema) else self.channels
        if known.setdefault(record.id, record) != record:
            # Outside chunks no checksum tells which of the two is right.
            self._gap(
                place.offset, place.end, "a topic is described here in another way than before"
            )

    def _data_end(self, place: Place) -> None:
        after = place.end < self._source.size and place_at(self._source, place.end).opcode
        if place.end < self._source.size and after not in (*SUMMARY_RECORDS, Opcode.FOOTER):
            raise BadRecord("an end of the data where there is none")
        body = self._source.peek(place.body, place.end - place.body)
        self.data_crc = parse(Opcode.DATA_END, body).data_section_crc
        self.data_end, self.after_data = place.offset, place.end

    def _is_skipped(self, place: Place) -> bool:
        is_header = place.opcode == Opcode.HEADER and place.offset == len(MAGIC)
        private = place.opcode >= PRIVATE and not self._finder.is_message(place)
        return is_header or private or (place.opcode in _SKIPPED and self._finder.begins(place.end))

    def _recover(self, offset: int, reason: str) -> int:
        """Find where the walk can continue after ``offset``, and note the gap between.

        Either the record at ``offset`` is damaged, or the length of the message before it is, so
        that ``offset`` lies in the midst of a record::

            ... | message | damaged ...... | record        the message is whole
                          ^ begin = offset ^ end

            ... | message, of a wrong length | record      it is not: it is taken back
                ^ begin                      ^ end

        The message before it is the last thing that was noted, so that taking it back undoes one
        step of the walk.
        """
        last, self._last_message = self._last_message, None
        if self.indexes:
            self.indexes[-1] = None
        chunk = self._finder.disguised_chunk(offset)
        if chunk is not None:
            return self._chunk(chunk)
        begin, seek = offset, offset + 1
        if last is not None and self._is_intact(*last):
            # A length that is too long by less than the padding does not show in the message.
            seek = offset - PADDING + 1
        elif last is not None:
            message, channel_id = last
            del self.loose[channel_id][-2:]
            self.recent_ns.pop()
            begin, seek = message.offset, message.offset + 1
        end = self._finder.next(seek, int(min(self._next_known(offset), self._source.size)))
        lossy = end > offset and (not self._known or bool(self.loose))
        self._gap(begin, end, reason, lossy=lossy)
        return end

    def _is_intact(self, place: Place, channel_id: int) -> bool:
        """Whether a message is as long as its own fields say."""
        channel = self.channels.get(channel_id)
        if channel is None:
            return False
        try:
            message = message_at(self._source, place.offset)
            return self._is_whole(channel, self.schemas.get(channel.schema_id), message)
        except BadRecord:
            return False

    def _gap(self, offset: int, end: int, reason: str, *, lossy: bool = True) -> None:
        before = self.recent_ns[-1] if self.recent_ns else None
        self.gaps.append(Gap(offset, end, reason, before, None, lossy))

    def _saw(self, first_ns: int, last_ns: int) -> None:
        for gap in self.gaps:
            if gap.after_ns is None:
                gap.after_ns = first_ns
        self.recent_ns.append(last_ns)


def _time_range(summary: Summary) -> tuple[float, float]:
    """Log times of the first and the last message, by the summary if that can be trusted."""
    statistics = summary.statistics
    if not summary.checked or statistics is None or not statistics.message_count:
        return -inf, inf
    return statistics.message_start_time, statistics.message_end_time
