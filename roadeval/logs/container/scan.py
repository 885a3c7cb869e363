"""The walk from record to record through a file, across damage.

A record is taken when the next one adds up as well. Else one of the two is damaged, or bytes are
missing: the next record that makes sense is looked for from just behind the head of the one in
doubt, for its end may be false. A chunk is taken when its checksum or the summary confirms it.
"""

from __future__ import annotations

import re
import struct
from array import array
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from functools import partial
from itertools import chain
from math import inf
from typing import Any, Final, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from roadeval.logs.container.records import (
    CHUNK,
    COMPRESSIONS,
    DEFINITIONS,
    DOUBTED,
    HEAD,
    LARGEST,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    PADDING,
    PRIVATE,
    Bytes,
    Chunk,
    ChunkReader,
    Entries,
    FileBytes,
    Message,
    Record,
    Summary,
    crc_of,
    message_at,
    parse,
    parse_chunk,
    parse_message_index,
    read_summary,
    record_at,
    walk,
)
from roadeval.logs.errors import BadRecord

END: Final = -1
"""In place of an opcode: the end of the file."""
BORDER: Final = -2
"""In place of an opcode: the eight bytes at which a log begins or ends."""
ATTACHMENT: Final = Opcode.ATTACHMENT
_BLOCK: Final = 1 << 20
"""Bytes to look through at a time."""
_TRIED: Final = 256
"""Bytes for which a place counts at which no record begins, besides those that one there claims."""
_CANDIDATE: Final = re.compile(
    rb"(?=[\x02-\x0f].{4}\x00{4}|\x89MCAP0\r\n\x01|\x06\xff{8})", re.DOTALL
)
"""The head of a record that is shorter than 4 GiB or was never ended, or a log's first bytes."""
_NOT_IN_CHUNKS: Final = (CHUNK, MESSAGE_INDEX, Opcode.DATA_END, Opcode.FOOTER)
"""Records that are never found inside a chunk, unlike messages and their descriptions."""
RECORDS: Final = 1 << 18
"""Records that chunks may hold beyond one for every few of their bytes: a bomb holds millions."""
BYTES_PER_RECORD: Final = 4
"""Bytes that a message takes at least, however well a chunk is compressed: its times differ."""

StampOf = Callable[[Channel, Schema | None, Message], int | None]
"""Return the header stamp of a message, None if it is not as long as its own fields say."""


class Gap(NamedTuple):
    """Bytes that make no sense, to ``end`` (excluded)."""

    offset: int
    end: int
    reason: str
    lossy: bool


class Scan:
    """What there is in a file."""

    def __init__(self, source: FileBytes, stamp_of: StampOf) -> None:
        self.reader = ChunkReader(source)
        self.summary = read_summary(source)
        self.chunks: list[Chunk] = []
        """In the order of the file."""
        self.indexes: list[dict[int, Entries] | None] = []
        """For each chunk, its messages by channel; None where its message indexes are damaged."""
        self.seen: dict[int, Mapping[int, Entries]] = {}
        """The same of the chunks that were looked into."""
        self.loose: dict[int, array[int]] = defaultdict(partial(array, "Q"))
        """Log times and offsets, in turn, of the messages outside chunks, by channel."""
        self.schemas = dict(self.summary.schemas)
        self.channels = dict(self.summary.channels)
        self.conflicts: list[tuple[int, Schema | Channel]] = []
        """Other descriptions than these outside chunks, with their offsets."""
        self.late: list[Schema | Channel] = []
        """Descriptions behind the data, from a summary that cannot be relied on."""
        self.gaps: list[Gap] = []
        self.data_end: int | None = None
        self.after_data: int | None = None
        """Where the data section ends, None if the file ends before; and what comes after it."""
        self.data_crc = 0
        """Its checksum, 0 if not given."""
        self.saved_ns: int | None = None
        """Log time of the last message saved from a chunk that is cut off."""
        self.next_log: int | None = None
        """Where another log begins in the same file."""
        self._source, self._stamp_of = source, stamp_of
        self._stop = None if self.summary.problem else self.summary.start
        self._records_left = RECORDS
        self._unsure: dict[int, array[int]] = defaultdict(partial(array, "Q"))
        """Messages as in ``loose``, but behind damage: they may be those of a damaged chunk."""
        self._is_unsure = False
        self._finder = RecordFinder(source, self.reader, self.summary, self.channels)
        self._walk()

    def _walk(self) -> None:
        begun = self._source[0 : len(MAGIC)] == MAGIC
        if not begun:
            self._gap(0, len(MAGIC), "the file does not begin as it should", lossy=False)
        record = Record(BORDER, 0, 0, len(MAGIC) if begun else 0)
        while record.opcode != END:
            try:
                following = self._following(record)
            except BadRecord as error:
                following = self._resync(record, str(error))
            else:
                self._take(record)
            if record.opcode == BORDER and record.offset and following.opcode == Opcode.HEADER:
                self.next_log = record.offset
                return
            record = following
        checked = self.chunks and all(chunk.crc for chunk in self.chunks)
        for channel_id, values in self._unsure.items() if not checked else ():
            self.loose[channel_id].extend(values)
        size = len(self._source)
        if self.data_end is None and not any(gap.lossy and gap.end == size for gap in self.gaps):
            self._gap(size, size, "the file was never finished; what came after is not in it")

    def _following(self, record: Record) -> Record:
        """Read the record behind one; refuse where that shows that either is damaged."""
        if record.opcode == CHUNK and not record.content.proven:
            raise BadRecord("a chunk that is not whole")
        if record.end != self._stop:
            return self._finder.record(record.end)
        if record.opcode != Opcode.DATA_END:
            reason = "the record that ends the data is missing"
            self._gap(record.end, record.end, reason, lossy=False)
            self.data_end = self.after_data = record.end
        return Record(END, record.end, record.end, record.end)

    def _resync(self, record: Record, reason: str) -> Record:
        """Find where the walk continues, where a record is in doubt or what follows it.

        ::

            ... | record | damaged ...... | next         the record is whole, and taken
            ... | record, of a wrong length . | next     it is not, and left out
            ... | record ...... | next .... |            bytes are missing in it: it is left out
        """
        is_chunk, proven = record.opcode == CHUNK, self._is_proven(record)
        following = None
        if proven or not is_chunk:
            following = self._finder.hidden_chunk(record.end)
        if following is None:
            following = self._finder.next(record.end if proven else record.offset + 1, record)
        if is_chunk and not proven:
            record = self._remains(record.content, following.offset)
        kept = proven or is_chunk or following.offset > record.end - PADDING
        if record.opcode == MESSAGE:
            kept = kept and self._is_whole(record)
        if kept:
            self._take(record)
        begin = record.end if kept else record.offset
        if following.offset > begin or not kept:
            if self.indexes and record.opcode in (CHUNK, MESSAGE_INDEX):
                self.indexes[-1] = None
            if self.data_end is None or following.opcode in (CHUNK, MESSAGE):
                self._gap(begin, following.offset, reason)
            self._is_unsure = True
        return following

    def _is_proven(self, record: Record) -> bool:
        """Whether a record surely ends where it says."""
        if record.opcode == ATTACHMENT:
            crc = crc_of(self._source.part(record.body, record.end - 4))
            return crc.to_bytes(4, "little") == self._source[record.end - 4 : record.end]
        if record.opcode == CHUNK:
            return self.reader.is_sound(record.content)
        return record.opcode == BORDER

    def _is_whole(self, record: Record) -> bool:
        """Whether a message is as long as its own fields say."""
        channel = self.channels.get(record.content[0])
        if channel is None:
            return False
        message = message_at(self._source, record.offset)
        return self._stamp_of(channel, self.schemas.get(channel.schema_id), message) is not None

    def _remains(self, chunk: Chunk, end: int) -> Record:
        """Return what is left of a chunk that is not whole, where the next record begins."""
        if chunk.cut and end == chunk.data_end:
            return chunk.record
        left = chunk._replace(data_size=max(end - chunk.data_offset, 0), cut=False)
        if end != chunk.data_end and self.reader.is_sound(left):
            return left._replace(repaired=True, proven=True).record
        left = left._replace(data_size=min(chunk.data_size, left.data_size))
        with suppress(BadRecord):
            self.reader.read(left)
        return left.record

    def _take(self, record: Record) -> None:
        """Note what a record says."""
        opcode, content = record.opcode, record.content
        if opcode == MESSAGE:
            channel_id, log_time = content
            messages = self._unsure if self._is_unsure else self.loose
            messages[channel_id].extend((log_time, record.offset))
        elif opcode in DEFINITIONS:
            known: dict[int, Any] = self.schemas if isinstance(content, Schema) else self.channels
            if self.data_end is not None and (content.id not in known or self.chunks):
                self.late.append(content)
            elif known.setdefault(content.id, content) != content:
                self.conflicts.append((record.offset, content))
        else:
            self._is_unsure = False
            if opcode == CHUNK:
                self._take_chunk(content)
            elif opcode == MESSAGE_INDEX and self.indexes:
                self._take_index(*content)
            elif opcode == Opcode.STATISTICS and self.summary.statistics is None:
                self.summary.statistics = content
            elif opcode == Opcode.DATA_END:
                self.data_end, self.after_data = record.offset, record.end
                self.data_crc = content.data_section_crc

    def _take_chunk(self, chunk: Chunk) -> None:
        if chunk.repaired:
            reason = "the head of a chunk is damaged; what it said was found out otherwise"
            self._gap(chunk.offset, chunk.data_offset, reason, lossy=False)
        self.chunks.append(chunk)
        self.indexes.append({})
        if chunk.cut:
            self._gap(chunk.offset, chunk.data_end, "the file ends inside a chunk")
        if self.summary.statistics is None:  # while it is uncompressed
            with suppress(BadRecord):
                self.look(len(self.chunks) - 1)

    def _take_index(self, channel_id: int, entries: Entries) -> None:
        """File a message index, unless it does not agree with its chunk."""
        chunk, index = self.chunks[-1], self.indexes[-1]
        if index is None or not len(entries):
            return
        times, offsets = entries[:, 0].view("u8"), entries[:, 1].view("u8")
        is_within = chunk.start <= times.min() and times.max() <= chunk.end
        if channel_id in index or not is_within or offsets.max() >= chunk.size:
            self.indexes[-1] = None
        else:
            index[channel_id] = entries

    def _gap(self, offset: int, end: int, reason: str, *, lossy: bool = True) -> None:
        self.gaps.append(Gap(offset, end, reason, lossy))

    def define(self, *records: Any) -> None:
        """Learn schemas and channels, unless they are known."""
        for record in records:
            known: dict[int, Any] = self.schemas if isinstance(record, Schema) else self.channels
            known.setdefault(record.id, record)

    def look(self, number: int) -> Mapping[int, Entries]:
        """Walk through the records of a chunk; learn its channels and where its messages lie."""
        chunk = self.chunks[number]
        records = self.reader.read(chunk)
        found: dict[int, array[int]] = defaultdict(partial(array, "Q"))
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
                found[channel_id].extend((log_time, offset))
            elif opcode in DEFINITIONS:
                with suppress(BadRecord):  # its messages will show that it is missing
                    self.define(parse(opcode, records[body:after]))
            elif opcode < PRIVATE:
                problem = "a chunk that holds more than messages, which is not read"
        if end != len(records) and not chunk.cut:
            problem = problem or "a chunk whose records do not add up"
        if problem:
            self.reader.kept.setdefault(chunk.offset, problem)
        if chunk.cut:
            self.saved_ns = max((max(values[::2]) for values in found.values()), default=None)
        self.seen[number] = {channel_id: entries_of(found[channel_id]) for channel_id in found}
        return self.seen[number]


def definitions(records: Bytes) -> list[Any]:
    """Return the schemas and channels of a chunk."""
    found = []
    for count, (opcode, _, body, end, _) in enumerate(walk(records)):
        if count == RECORDS:
            break
        if opcode in DEFINITIONS:
            with suppress(BadRecord):
                found.append(parse(opcode, records[body:end]))
    return found


def entries_of(values: array[int]) -> Entries:
    """Return rows of a flat array of log times and offsets."""
    return np.frombuffer(values, np.int64).reshape(-1, 2)


class RecordFinder:
    """Reads the record at a byte, if its parts agree, and finds the next one that does.

    ``channels`` are the numbers of the known ones; they grow while this object is used.
    """

    def __init__(
        self, source: FileBytes, reader: ChunkReader, summary: Summary, channels: Collection[int]
    ) -> None:
        self._source, self._reader, self._summary = source, reader, summary
        self._size = len(source)
        self._channels = channels
        self._sizes = {chunk.listing[2:] for chunk in summary.chunks.values() if summary.checked}
        self._proven: dict[int, Chunk] = {}
        self._known = summary.chunks if summary.checked else {}
        self._borders = sorted(self._known)
        if self._known and summary.start is not None:
            self._borders.append(summary.start)
        self._tries_left = DOUBTED + 4 * len(source)

    def record(self, offset: int) -> Record:
        """Read the record that begins here."""
        head = self._source[offset : offset + HEAD.size + MESSAGE_HEAD.size]
        if head.startswith(MAGIC) or not head:
            end = offset + len(head[: len(MAGIC)])
            return Record(BORDER if head else END, offset, offset, end)
        if len(head) < HEAD.size:
            raise BadRecord("the file is cut off")
        opcode, length = HEAD.unpack_from(head)
        body = offset + HEAD.size
        record = Record(opcode, offset, body, body + length)
        if opcode == CHUNK or offset in self._known:
            return self._chunk(record).record
        if opcode == ATTACHMENT and not self._is_attachment(record):
            raise BadRecord("an attachment whose lengths contradict each other")
        if record.end > self._size:
            raise BadRecord("a record that goes on beyond the end of the file")
        if self._borders and record.end > self._border(offset):
            raise BadRecord("a record that goes on into the next chunk")
        content = self._message(record, head) if opcode == MESSAGE else self._content(record)
        return Record(opcode, offset, body, record.end, content)

    def _border(self, offset: int) -> float:
        """Where the next chunk or the summary begins, by the summary."""
        index = bisect_right(self._borders, offset)
        return self._borders[index] if index < len(self._borders) else inf

    def _content(self, record: Record) -> Any:
        """Read what a record says that is no chunk and no message."""
        opcode, _, body, end, _ = record
        if opcode >= PRIVATE:  # or a message whose kind is damaged
            channel_id = int.from_bytes(self._source[body : body + 2], "little")
            if not (MESSAGE_HEAD.size <= end - body <= LARGEST and self._is_known(channel_id)):
                return None
        if opcode == ATTACHMENT:
            return None
        if end - body > LARGEST:
            raise BadRecord("a record of a length that cannot be")
        if opcode == MESSAGE_INDEX:
            return parse_message_index(self._source[body:end])
        return parse(opcode, self._source[body:end])

    def _message(self, record: Record, head: bytes) -> tuple[int, int]:
        """Read the channel and the log time of a message outside chunks."""
        if not MESSAGE_HEAD.size <= record.end - record.body <= LARGEST:
            raise BadRecord("a message of a length that cannot be")
        if self._known and self._is_index_here(record.offset):
            raise BadRecord("a message where a message index should be")
        channel_id, _, log_time, _ = MESSAGE_HEAD.unpack_from(head, HEAD.size)
        return channel_id, log_time

    def _is_index_here(self, offset: int) -> bool:
        """Whether a message index lies here, by the summary."""
        chunk = self._borders[bisect_right(self._borders, offset) - 1]
        return offset < self._summary.index_ends.get(chunk, 0)

    def _is_known(self, channel_id: int) -> bool:
        return not self._channels or channel_id in self._channels

    def _is_attachment(self, record: Record) -> bool:
        """Whether an attachment's own length and that of its data agree."""
        at, end = record.body + 16, inf
        with suppress(struct.error):
            for _ in range(2):
                at += 4 + struct.unpack("<I", self._source[at : at + 4])[0]
            end = at + 8 + struct.unpack("<Q", self._source[at : at + 8])[0] + 4
        return end <= record.end

    def _chunk(self, record: Record) -> Chunk:
        """Read a chunk's head, which gives its length twice, and the summary a third time."""
        offset, heads = record.offset, list[Chunk]()
        if offset in self._proven:
            return self._proven[offset]
        listed, agrees = self._summary.chunks.get(offset), False
        with suppress(BadRecord):
            own = parse_chunk(self._source, record)
            agrees = own.data_end == record.end and record.opcode == CHUNK
            if agrees and listed and own.listing == listed.listing:
                return own._replace(proven=True)
            heads = [own, own._replace(data_size=record.end - own.data_offset)]
        crc = int.from_bytes(self._source[record.body + 24 : record.body + 28], "little")
        known = [listed._replace(crc=crc or None)] if listed and self._summary.checked else []
        sized = (self._reader.sized(chunk) for chunk in heads if chunk.crc)
        for chunk in chain(known, heads, sized):
            # Zeros would be an empty chunk.
            if chunk.data_size >= 0 and (chunk.size or agrees) and self._reader.is_sound(chunk):
                repaired = not agrees or chunk != heads[0]
                self._proven[offset] = chunk._replace(repaired=repaired, proven=True)
                return self._proven[offset]
        if agrees and record.end <= min(self._border(offset), self._size):
            return heads[0]
        if heads and min(each.data_end for each in heads) > self._size >= heads[0].data_offset:
            return heads[0]._replace(data_size=self._size - heads[0].data_offset, cut=True)
        raise BadRecord("a chunk whose lengths contradict each other")

    def hidden_chunk(self, offset: int) -> Record | None:
        """Find a chunk here whose kind or lengths are damaged, by its checksum."""
        with suppress(BadRecord):
            chunk = parse_chunk(self._source, record_at(self._source, offset))
            if chunk.compression in COMPRESSIONS:
                anything = Record(CHUNK, offset, offset, self._size)
                for end in (chunk.data_end, self.next(chunk.data_offset, anything).offset):
                    found = chunk._replace(data_size=end - chunk.data_offset, repaired=True)
                    if found.data_size > 0 and self._reader.is_sound(found):
                        return found._replace(proven=True).record
        return None

    def next(self, begin: int, doubted: Record) -> Record:
        """Find the next record that makes sense at or after ``begin``, or the end of the file.

        The damage is in or behind the record ``doubted``. What lies in a chunk are no records of
        the file.
        """
        size = self._size
        for offset in self._candidates(begin):
            if self._source[offset : offset + len(MAGIC)] == MAGIC:
                if self._source[offset - 8 : offset] == MAGIC or (
                    not self._summary.checked and self._source[0:8] == MAGIC
                ):  # else it may be this log's own beginning, moved
                    return Record(BORDER, offset, offset, offset + len(MAGIC))
                continue
            with suppress(BadRecord):
                claimed = record_at(self._source, offset).end - offset
                self._tries_left -= _TRIED + (claimed if claimed <= size - offset else 0)
                if self._tries_left < 0:
                    break
                record = self.record(offset)
                if self._is_believed(record, doubted):
                    return record
        return Record(END, size, size, size)

    def _candidates(self, begin: int) -> Iterator[int]:
        """Yield the bytes at or after ``begin`` where a record may begin."""
        for at in range(begin, self._size, _BLOCK):
            block = self._source[at : at + _BLOCK + HEAD.size]
            found = {at + match.start() for match in _CANDIDATE.finditer(block)}
            found.update(border for border in self._borders if at <= border < at + _BLOCK)
            yield from sorted(each for each in found if each < at + _BLOCK)

    def _is_believed(self, record: Record, doubted: Record) -> bool:
        """Whether it is more than chance that this looks like a record of the log."""
        opcode, content = record.opcode, record.content
        in_chunk = doubted.opcode == CHUNK and record.offset < doubted.end
        if opcode == CHUNK:
            ours = content.listing[2:] in self._sizes
            if not self._sizes:
                ours = content.compression in COMPRESSIONS
            return ours and (content.proven or not in_chunk)
        misplaced = opcode in (END, BORDER, Opcode.HEADER)
        if misplaced or (in_chunk and opcode not in _NOT_IN_CHUNKS):
            return False
        if opcode == MESSAGE_INDEX and content[1].nbytes + 6 == record.end - record.body:
            return not self._known or self._is_index_here(record.offset)
        if opcode == MESSAGE and not self._is_known(content[0]):
            return False
        with suppress(BadRecord):
            return bool(self.record(record.end))
        return False
