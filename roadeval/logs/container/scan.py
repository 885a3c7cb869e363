"""The walk from record to record through a file, across damage.

A record is accepted if the next one is valid as well. Otherwise one of the two is damaged, or bytes
are missing. The search for the next valid record begins just behind the head of the doubtful one,
because its end may be wrong. A chunk is accepted if its checksum or the summary confirms it.
"""

from __future__ import annotations

import re
import struct
from array import array
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from itertools import islice
from math import inf
from typing import Any, Final, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from roadeval.logs.container import records
from roadeval.logs.container.records import CHUNK, HEAD, MAGIC, MESSAGE, MESSAGE_HEAD, Record
from roadeval.logs.errors import BadRecord

END: Final = -1
"""Stands for an opcode: the end of the file."""
BORDER: Final = -2
"""Stands for an opcode: the eight bytes at which a log begins or ends."""
_CANDIDATE: Final = re.compile(
    rb"(?=[\x02-\x0f].{4}\x00{4}|\x89MCAP0\r\n\x01|\x06\xff{8})", re.DOTALL
)
"""The head of a record that is shorter than 4 GiB or was never ended, or a log's first bytes."""
_HEADS: Final = HEAD.size + MESSAGE_HEAD.size
_NOT_IN_CHUNKS: Final = (CHUNK, records.MESSAGE_INDEX, Opcode.DATA_END, Opcode.FOOTER)
"""Records that never lie inside a chunk, unlike messages and their descriptions."""
RECORDS: Final = 1 << 18
"""Records of a chunk beyond one for every four of its bytes: a bomb holds millions."""

StampOf = Callable[[Channel, Schema | None, records.Message], int | None]
"""Return the header stamp of a message; None if its fields contradict its length."""


class Gap(NamedTuple):
    """Invalid bytes from ``offset`` up to ``end`` (excluded)."""

    offset: int
    end: int
    reason: str
    lossy: bool = True


class Scan:
    """The chunks, messages, descriptions and gaps of a file."""

    def __init__(self, source: records.FileBytes, stamp_of: StampOf) -> None:
        self.source, self.stamp_of = source, stamp_of
        self.reader = records.ChunkReader(source)
        self.summary = records.read_summary(source)
        self.chunks: list[records.Chunk] = []
        """The chunks in the order of the file."""
        self.indexes: list[dict[int, records.Entries] | None] = []
        """Each chunk's messages by channel; None if its message indexes are damaged."""
        self.seen: dict[int, Mapping[int, records.Entries]] = {}
        """The messages by channel of the chunks that were looked into."""
        self.loose: dict[int, array[int]] = defaultdict(partial(array, "Q"))
        """Log times and offsets, in turn, of the messages outside chunks, by channel."""
        self.schemas = dict(self.summary.schemas)
        self.channels = dict(self.summary.channels)
        self.conflicts: list[tuple[int, Schema | Channel]] = []
        """Descriptions that contradict known ones, with the offset of each or of its chunk."""
        self.late: list[Schema | Channel] = []
        """Descriptions behind the data, from a summary that is not reliable."""
        self.gaps: list[Gap] = []
        self.data_end: int | None = None
        self.after_data: int | None = None
        """Ends of the data section and of the record that ends it; None if the file ends before."""
        self.data_crc = 0
        """Checksum of the data section; 0 if there is none."""
        self.saved_ns: int | None = None
        """Log time of the last message before the cut of a chunk that is cut off."""
        self.next_log: int | None = None
        """The byte at which another log begins in the same file."""
        self._stop = None if self.summary.problem else self.summary.start
        self._listed = self.summary.chunks if self.summary.checked else {}
        end = self.summary.start or inf
        self._borders = [0, *sorted(self._listed), *[end] * bool(self._listed), inf]
        self._sizes = {(chunk.size, chunk.data_size) for chunk in self._listed.values()}
        self._records_left = RECORDS
        self._tries_left = records.DOUBTED + 4 * len(source)
        self._walk()

    def _walk(self) -> None:
        begun = self.source[0 : len(MAGIC)] == MAGIC
        if not begun:
            self.gaps.append(Gap(0, len(MAGIC), "the file does not begin as it should", False))
        index_ends, most = self.summary.index_ends, records.IN_MEMORY
        self.source.expect(  # the indexes of each chunk, and the head of the next one
            (chunk.data_end, min(index_ends[at], chunk.data_end + most) + records.CHUNK_BEGIN)
            for at, chunk in sorted(self.summary.chunks.items())
        )
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
        size, ends = len(self.source), {gap.end for gap in self.gaps if gap.lossy}
        if ends and self.chunks and all(chunk.crc for chunk in self.chunks):
            self.loose.clear()  # they may belong to a damaged chunk
        if self.data_end is None and size not in ends:
            reason = "the file was never finished; what came after is not in it"
            self.gaps.append(Gap(size, size, reason))

    def _following(self, record: Record) -> Record:
        """Read the record behind this one; a `BadRecord` if that shows that either is damaged."""
        if record.opcode == CHUNK and not record.content.proven:
            raise BadRecord("a chunk that is not whole")
        if record.end != self._stop:
            return self._record(record.end)
        if record.opcode != Opcode.DATA_END:
            reason = "the record that ends the data is missing"
            self.gaps.append(Gap(record.end, record.end, reason, False))
            self.data_end = self.after_data = record.end
        return Record(END, record.end, record.end, record.end)

    def _resync(self, record: Record, reason: str) -> Record:
        """Find the next record of the walk if a record, or what follows it, is doubtful.

        ::

            ... | record | damaged ...... | next         the record is complete, and taken
            ... | record, of a wrong length . | next     it is not complete, and left out
            ... | record ...... | next .... |            it lacks bytes, and is left out
        """
        in_doubt = record.opcode == CHUNK and self.reader.proof(record.content) is None
        is_complete = record.opcode in (CHUNK, BORDER) and not in_doubt
        search_from = record.end if is_complete else record.offset + 1
        following = None if in_doubt else self._hidden_chunk(record.end)
        following = following or self._next(search_from, record)
        if in_doubt:
            record = self._remains(record.content, following.offset)
        is_taken = is_complete or in_doubt or following.offset > record.end - records.PADDING
        if record.opcode == MESSAGE and is_taken:  # if its fields do not contradict its length
            channel = self.channels.get(record.content[0])
            schema = self.schemas.get(channel.schema_id) if channel else None
            is_taken = channel is not None and (
                self.stamp_of(channel, schema, records.message_at(self.source, record.offset))
                is not None
            )
        if is_taken:
            self._take(record)
        begin = record.end if is_taken else record.offset
        if following.offset > begin or not is_taken:
            if self.indexes and record.opcode in (CHUNK, records.MESSAGE_INDEX):
                self.indexes[-1] = None
            if self.data_end is None or following.opcode in (CHUNK, MESSAGE):
                self.gaps.append(Gap(begin, following.offset, reason))
        return following

    def _remains(self, chunk: records.Chunk, end: int) -> Record:
        """Return what is left of a damaged chunk before the next record, at ``end``."""
        if chunk.cut and end == chunk.data_end:
            return chunk.record
        left = chunk._replace(data_size=max(end - chunk.data_offset, 0), cut=False)
        if end != chunk.data_end and (proven := self.reader.proof(left)):
            return proven._replace(repaired=True).record
        left = left._replace(data_size=min(chunk.data_size, left.data_size))
        with suppress(BadRecord):
            self.reader.read(left)
        return left.record

    def _take(self, record: Record) -> None:
        """Note the content of a record."""
        opcode, content = record.opcode, record.content
        if opcode == MESSAGE:
            channel_id, log_time = content
            self.loose[channel_id].extend((log_time, record.offset))
        elif opcode == CHUNK:
            self._take_chunk(content)
        elif opcode == records.MESSAGE_INDEX and self.chunks and self.indexes[-1] is not None:
            channel_id, entries = content
            chunk, index = self.chunks[-1], self.indexes[-1]
            if len(entries):
                times, offsets = entries[:, 0].view("u8"), entries[:, 1].view("u8")
                is_within = chunk.start <= times.min() and times.max() <= chunk.end
                if channel_id in index or not is_within or offsets.max() >= chunk.size:
                    self.indexes[-1] = None  # it contradicts its chunk
                else:
                    index[channel_id] = entries
        elif opcode in records.DEFINITIONS:
            is_new = content.id not in self.described(content)
            if self.data_end is not None and (is_new or self.chunks):
                self.late.append(content)
            else:
                self.define(content, record.offset)
        elif opcode == Opcode.STATISTICS and self.summary.statistics is None:
            self.summary.statistics = content
        elif opcode == Opcode.DATA_END:
            self.data_end, self.after_data = record.offset, record.end
            self.data_crc = content.data_section_crc

    def _take_chunk(self, chunk: records.Chunk) -> None:
        if chunk.repaired:
            reason = "the head of a chunk is damaged; what it said was found out otherwise"
            self.gaps.append(Gap(chunk.offset, chunk.data_offset, reason, False))
        self.chunks.append(chunk)
        self.indexes.append({})
        if chunk.cut:
            self.gaps.append(Gap(chunk.offset, chunk.data_end, "the file ends inside a chunk"))
        if self.summary.statistics is None:  # while it is uncompressed
            if len(self.chunks) == 1:
                self.source.expect([(chunk.data_offset, len(self.source))])
            with suppress(BadRecord):
                self.look(len(self.chunks) - 1)

    def described(self, record: Schema | Channel) -> dict[int, Any]:
        """Return the known descriptions of the same kind, by their numbers."""
        return self.schemas if isinstance(record, Schema) else self.channels

    def define(self, record: Any, offset: int | None = None) -> None:
        """Add a new description; note one from the data that contradicts a known one."""
        other = self.described(record).setdefault(record.id, record)
        # Each conflict is tried on messages, so their number is limited.
        if offset is None or record == other or len(self.conflicts) >= 64:
            return
        if record not in (conflict for _, conflict in self.conflicts):
            self.conflicts.append((offset, record))

    def look(self, number: int) -> Mapping[int, records.Entries]:
        """Walk through a chunk; add its channels, and return the places of its messages."""
        chunk = self.chunks[number]
        content = self.reader.read(chunk)
        messages: dict[int, array[int]] = defaultdict(partial(array, "Q"))
        end, problem = 0, ""
        # However well a chunk is compressed, a message takes four bytes: its times differ.
        usual = chunk.data_size // 4
        allowed = usual + self._records_left // 2
        for count, (opcode, offset, body, after, _) in enumerate(records.walk(content)):
            if count == allowed:
                problem = f"a chunk of so many records that only the first {allowed} were read"
                self._records_left -= allowed - usual
                break
            end = after
            if opcode == MESSAGE and after - body >= MESSAGE_HEAD.size:
                head = content[body : body + MESSAGE_HEAD.size]
                channel_id, _, log_time, _ = MESSAGE_HEAD.unpack(head)
                messages[channel_id].extend((log_time, offset))
            elif opcode in records.DEFINITIONS:
                with suppress(BadRecord):  # its messages will show that the description is missing
                    self.define(records.parse(opcode, content[body:after]), chunk.offset)
            elif opcode < records.PRIVATE:
                problem = "a chunk that holds more than messages, which is not read"
        if end != len(content) and not chunk.cut:
            problem = problem or "a chunk whose records do not add up"
        if problem:
            self.reader.flawed.setdefault(chunk.offset, problem)
        if chunk.cut:
            self.saved_ns = max((max(values[::2]) for values in messages.values()), default=None)
        self.seen[number] = {channel_id: entries_of(flat) for channel_id, flat in messages.items()}
        return self.seen[number]

    # --- The record at a byte, and the next one that makes sense ----------------------------------

    def _record(self, offset: int) -> Record:
        """Read the record that begins here; a `BadRecord` if its parts contradict each other."""
        head = self.source[offset : offset + _HEADS]
        if head.startswith(MAGIC) or not head:
            end = offset + len(head[: len(MAGIC)])
            return Record(BORDER if head else END, offset, offset, end)
        if len(head) < HEAD.size:
            raise BadRecord("the file is cut off")
        opcode, length = HEAD.unpack_from(head)
        body = offset + HEAD.size
        record = Record(opcode, offset, body, body + length)
        if opcode == CHUNK or offset in self._listed:
            return self._chunk(record).record
        if record.end > len(self.source):
            raise BadRecord("a record that goes on beyond the end of the file")
        if record.end > self._around(offset)[1]:
            raise BadRecord("a record that goes on into the next chunk")
        return record._replace(content=self._content(record, head))

    def _content(self, record: Record, head: bytes) -> Any:
        """Read a record that is not a chunk; return channel and log time of a message."""
        opcode, offset, body, end, _ = record
        if opcode == Opcode.ATTACHMENT:
            at, inner = body + 16, inf
            with suppress(struct.error):
                for _ in range(2):  # name and media type
                    at += 4 + struct.unpack("<I", self.source[at : at + 4])[0]
                inner = at + 8 + struct.unpack("<Q", self.source[at : at + 8])[0] + 4
            if inner > end:
                raise BadRecord("an attachment whose lengths contradict each other")
            return None
        if opcode == MESSAGE or opcode >= records.PRIVATE:
            fits = MESSAGE_HEAD.size <= end - body <= records.LARGEST
            channel_id, _, log_time, _ = MESSAGE_HEAD.unpack_from(head.ljust(_HEADS), HEAD.size)
            if opcode != MESSAGE and fits and self._is_described(channel_id):
                raise BadRecord("a message whose kind is damaged")
            if opcode == MESSAGE and not fits:
                raise BadRecord("a message of a length that cannot be")
            if self._is_index_here(offset):
                raise BadRecord("a message where a message index should be")
            return channel_id, log_time
        if end - body > records.LARGEST:
            raise BadRecord("a record of a length that cannot be")
        data = self.source[body:end]
        return (
            records.parse_message_index(data)
            if opcode == records.MESSAGE_INDEX
            else records.parse(opcode, data)
        )

    def _around(self, offset: int) -> tuple[float, float]:
        """Return the beginnings of the chunk at or before a byte and of the next one."""
        index = bisect_right(self._borders, offset)
        return self._borders[index - 1], self._borders[index]

    def _is_index_here(self, offset: int) -> bool:
        """Return whether a message index lies here, by the summary."""
        return offset < self.summary.index_ends.get(int(self._around(offset)[0]), 0)

    def _is_described(self, channel_id: int) -> bool:
        return not self.channels or channel_id in self.channels

    def _chunk(self, record: Record) -> records.Chunk:
        """Return the chunk by its head, which gives the length twice, and by the summary."""
        heads, agrees, size = list[records.Chunk](), False, len(self.source)
        listed = self.summary.chunks.get(record.offset)
        with suppress(BadRecord):
            head = records.parse_chunk(self.source, record)
            agrees = head.data_end == record.end and record.opcode == CHUNK
            if agrees and listed == head._replace(crc=0):
                return head._replace(proven=True)
            heads = [head, head._replace(data_size=record.end - head.data_offset)]
        crc = int.from_bytes(self.source[record.body + 24 : record.body + 28], "little")
        by_summary = [listed._replace(crc=crc)] if listed and self._listed else []
        for chunk in (*by_summary, *heads):
            if proven := self.reader.proof(chunk):
                repaired = not agrees or proven._replace(proven=False) != heads[0]
                return proven._replace(repaired=repaired)
        if agrees and record.end <= min(self._around(record.offset)[1], size):
            return heads[0]
        if heads and min(chunk.data_end for chunk in heads) > size >= heads[0].data_offset:
            return heads[0]._replace(data_size=size - heads[0].data_offset, cut=True)
        raise BadRecord("a chunk whose lengths contradict each other")

    def _hidden_chunk(self, offset: int) -> Record | None:
        """Find a chunk here by its checksum, although its kind or lengths are damaged."""
        with suppress(BadRecord):
            chunk = records.parse_chunk(self.source, records.record_at(self.source, offset))
            anything = Record(CHUNK, offset, offset, len(self.source))
            if chunk.compression in records.COMPRESSIONS:
                for end in (chunk.data_end, self._next(chunk.data_offset, anything).offset):
                    left = chunk._replace(data_size=end - chunk.data_offset, repaired=True)
                    if proven := self.reader.proof(left):
                        return proven.record
        return None

    def _next(self, begin: int, doubted: Record) -> Record:
        """Find the next valid record at or after ``begin``, or the end of the file.

        The damage is in or behind the record ``doubted``. Records in a chunk are not records of the
        file.
        """
        size = len(self.source)
        for offset in self._candidates(begin):
            if self.source[offset : offset + len(MAGIC)] == MAGIC:
                # Unless it follows an end, it may be the beginning of this log, which was moved.
                begun = not self.summary.checked and self.source[0:8] == MAGIC
                if begun or self.source[offset - 8 : offset] == MAGIC:
                    return Record(BORDER, offset, offset, offset + len(MAGIC))
                continue
            with suppress(BadRecord):
                # A place counts as 256 bytes, and the bytes that a record there claims.
                claimed = records.record_at(self.source, offset).end - offset
                self._tries_left -= 256 + (claimed if claimed <= size - offset else 0)
                if self._tries_left < 0:
                    break
                record = self._record(offset)
                if self._is_believed(record, doubted):
                    return record
        return Record(END, size, size, size)

    def _candidates(self, begin: int) -> Iterator[int]:
        """Yield the positions from ``begin`` on at which a record may begin."""
        for at in range(begin, len(self.source), records.BLOCK):
            block = self.source[at : at + records.BLOCK + HEAD.size]
            offsets = {at + match.start() for match in _CANDIDATE.finditer(block)}
            offsets |= {
                int(border) for border in self._borders if at <= border < at + records.BLOCK
            }
            yield from sorted(offset for offset in offsets if offset < at + records.BLOCK)

    def _is_believed(self, record: Record, doubted: Record) -> bool:
        """Return whether these bytes are a record of the log, and hardly by chance."""
        opcode, content = record.opcode, record.content
        in_chunk = doubted.opcode == CHUNK and record.offset < doubted.end
        if opcode == CHUNK:
            is_listed = (content.size, content.data_size) in self._sizes
            ours = is_listed if self._sizes else content.compression in records.COMPRESSIONS
            return bool(content.proven or (ours and not in_chunk))
        if opcode in (END, BORDER, Opcode.HEADER) or (in_chunk and opcode not in _NOT_IN_CHUNKS):
            return False
        if opcode == records.MESSAGE_INDEX and content[1].nbytes + 6 == record.end - record.body:
            return not self._listed or self._is_index_here(record.offset)
        if opcode == MESSAGE and not self._is_described(content[0]):
            return False
        self._record(record.end)
        return True


def definitions(content: records.Bytes) -> list[Any]:
    """Return the schemas and channels of a chunk."""
    descriptions = []
    for opcode, _, body, end, _ in islice(records.walk(content), RECORDS):
        if opcode in records.DEFINITIONS:
            with suppress(BadRecord):
                descriptions.append(records.parse(opcode, content[body:end]))
    return descriptions


def entries_of(values: array[int]) -> records.Entries:
    """Return the rows of a flat array of log times and offsets."""
    return np.frombuffer(values, np.int64).reshape(-1, 2)
