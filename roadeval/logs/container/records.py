"""Bytes by position, and the records of an MCAP file in them.

The layouts are those of https://mcap.dev/spec. The `mcap` library reads all records but messages,
chunks and message indexes: those are read here from a few bytes, so that a file can be walked
through without reading its data. Whatever does not add up raises a `BadRecord`.
"""

from __future__ import annotations

import io
import struct
import sys
from collections.abc import Callable, Iterator
from typing import IO, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from mcap import records as mcap_records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode

from roadeval.logs.errors import BadRecord

MAGIC: Final = b"\x89MCAP0\r\n"
HEAD: Final = struct.Struct("<BQ")
"""Opcode and length, before every record's body."""
MESSAGE_HEAD: Final = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time."""
CHUNK_HEAD: Final = struct.Struct("<QQQII")
"""Start time, end time, uncompressed size, CRC, length of the compression's name."""
INDEX_HEAD: Final = struct.Struct("<HI")
"""Channel, bytes of entries."""
LARGEST: Final = 1 << 28
"""Bytes of a message or definition; one that claims more is damaged."""
LONGEST_NAME: Final = 64
"""No compression has a longer name; a chunk that claims so is damaged."""
CHUNK, MESSAGE, MESSAGE_INDEX = Opcode.CHUNK, Opcode.MESSAGE, Opcode.MESSAGE_INDEX
"""Kinds that are asked for at every record: an enumeration takes ten times as long to ask."""
PRIVATE: Final = 0x80
"""Opcodes from here on belong to applications."""
PADDING: Final = 4
"""A message may be padded at its end to a multiple of so many bytes, as CDR does."""

WINDOW: Final = 64 << 10
"""Bytes read at once while walking from record to record."""
GLANCE: Final = 1 << 10
"""Bytes read at once after a leap, as over the data of a chunk."""

Buffer = bytes | memoryview
Entries = npt.NDArray[np.int64]
"""``(n, 2)``: log times of messages, and offsets of their records in the chunk."""


class FileBytes:
    """A part of a file, sliced like `bytes`; a `BadRecord` where the disk fails.

    Nothing is mapped: pages of a mapped file count as memory of the program, and a file that
    shrinks while it is read would end the program with a bus error.
    """

    def __init__(self, file: IO[bytes], begin: int = 0, size: int | None = None) -> None:
        self._file = file
        self.begin = begin
        self._size = file.seek(0, 2) - begin if size is None else size
        self._window = memoryview(b"")
        self._window_at = self._at = 0

    def part(self, begin: int, end: int) -> FileBytes:
        """Return a part of this part."""
        return FileBytes(self._file, self.begin + begin, end - begin)

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, part: slice, /) -> Buffer:
        start, stop = min(part.start, self._size), min(part.stop, self._size)
        at, end = start - self._window_at, stop - self._window_at
        if at < 0 or end > len(self._window):
            if stop - start > GLANCE:
                return self._read(start, stop - start)
            walks_on = 0 <= at <= len(self._window) + GLANCE
            window = min(WINDOW if walks_on else GLANCE, self._size - start)
            self._window, self._window_at = memoryview(self._read(start, window)), start
            at, end = 0, max(stop - start, 0)
        return self._window[at:end]

    def _read(self, offset: int, length: int) -> bytes:
        try:
            self._file.seek(self.begin + offset)
            data = self._file.read(length)
            while len(data) < length and (more := self._file.read(length - len(data))):
                data += more
        except OSError as error:
            raise BadRecord(f"unreadable on its disk ({error.strerror})") from error
        return data

    def read(self, size: int) -> bytes:
        """Return the next bytes, as a file does; none at the end."""
        data = bytes(self[self._at : self._at + size])
        self._at += len(data)
        return data

    def close(self) -> None:
        """Close the file."""
        self._file.close()


Bytes = FileBytes | memoryview
"""Bytes that need not lie in memory."""


class Record(NamedTuple):
    """A record: ``offset`` of its opcode, ``body`` of its content, ``end`` after it."""

    opcode: int
    offset: int
    body: int
    end: int
    content: Any = None
    """What it says, as far as that was read."""


class Message(NamedTuple):
    """A message as logged; times are nanoseconds."""

    channel_id: int
    sequence: int
    log_time: int
    publish_time: int
    data: memoryview


class Chunk(NamedTuple):
    """A chunk's head: where its data lies in the file, and what it claims to hold."""

    offset: int
    start: int
    end: int
    """Log times of its first and its last message."""
    size: int
    """Bytes of its records, uncompressed."""
    crc: int | None
    """Checksum of these; 0 if not given, None if it may be damaged."""
    compression: str
    data_offset: int
    data_size: int
    cut: bool = False
    """Whether it continues beyond the end of the file."""
    repaired: bool = False
    """Whether its own head is damaged, and what it says was found out otherwise."""

    @property
    def data_end(self) -> int:
        """Where its data ends in the file."""
        return self.data_offset + self.data_size

    @property
    def listing(self) -> tuple[object, ...]:
        """What the summary says of it as well, but for its place."""
        return self.start, self.end, self.size, self.compression, self.data_size


class _Strict(ReadDataStream):
    """The library's stream, that refuses a read across the record's end."""

    def read(self, length: int) -> bytes:
        data: bytes = super().read(length) if length <= sys.maxsize else b""
        if len(data) != length:
            raise EndOfFile
        return data


_READERS: Final[dict[int, Callable[[ReadDataStream], Any]]] = {
    opcode: getattr(mcap_records, opcode.name.title().replace("_", "")).read
    for opcode in Opcode
    if opcode not in (Opcode.MESSAGE, Opcode.CHUNK)
}


def parse(opcode: int, body: Buffer) -> Any:
    """Read a record that is neither message nor chunk, by the `mcap` library."""
    if opcode not in _READERS:
        raise BadRecord(f"a record of unknown kind {opcode}")
    try:
        return _READERS[opcode](_Strict(io.BytesIO(body)))
    except (EndOfFile, struct.error, UnicodeDecodeError) as error:
        raise BadRecord(f"a {Opcode(opcode).name.lower()} record that does not add up") from error


def parse_chunk(source: Bytes, record: Record) -> Chunk:
    """Read a chunk's head; the length that it says of its data may contradict the record's own."""
    head = source[record.body : record.body + CHUNK_HEAD.size + LONGEST_NAME + 8]
    if len(head) < CHUNK_HEAD.size:
        raise BadRecord("a chunk without a head")
    start, end, size, crc, name_length = CHUNK_HEAD.unpack_from(head)
    data_at = CHUNK_HEAD.size + name_length + 8
    if name_length > LONGEST_NAME or len(head) < data_at:
        raise BadRecord("a chunk whose head is damaged")
    name = bytes(head[CHUNK_HEAD.size : data_at - 8]).decode("utf-8", "replace")
    (data_size,) = struct.unpack_from("<Q", head, data_at - 8)
    return Chunk(record.offset, start, end, size, crc, name, record.body + data_at, data_size)


def parse_message_index(body: Buffer) -> tuple[int, Entries]:
    """Read a message index: the channel, and its messages."""
    channel_id, length = INDEX_HEAD.unpack_from(body) if len(body) >= INDEX_HEAD.size else (0, 1)
    if length % 16 or INDEX_HEAD.size + length > len(body):
        raise BadRecord("a message index whose lengths contradict each other")
    entries = bytes(body[INDEX_HEAD.size : INDEX_HEAD.size + length])
    return channel_id, np.frombuffer(entries, "<i8").reshape(-1, 2)


def message_at(records: Bytes, offset: int) -> Message:
    """Read the message whose record begins at ``offset``."""
    head = records[offset : offset + HEAD.size]
    opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)
    if opcode != MESSAGE or not MESSAGE_HEAD.size <= length <= LARGEST:
        raise BadRecord("no message where the index says")
    body = memoryview(records[offset + HEAD.size : offset + HEAD.size + length])
    if len(body) < length:
        raise BadRecord("a message that is cut off")
    channel_id, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(body)
    return Message(channel_id, sequence, log_time, publish_time, body[MESSAGE_HEAD.size :])


def record_at(records: Bytes, offset: int) -> Record:
    """Read the head of the record at ``offset``; it may claim to go beyond the end."""
    head = records[offset : offset + HEAD.size]
    if len(head) < HEAD.size:
        raise BadRecord("the file is cut off")
    opcode, length = HEAD.unpack(head)
    return Record(opcode, offset, offset + HEAD.size, offset + HEAD.size + length)


def walk(records: Bytes, offset: int = 0) -> Iterator[Record]:
    """Yield the records of a chunk from ``offset`` on, as far as they are whole.

    Zeros end them, too: a million would be as many records of no kind and no length.
    """
    size = len(records)
    while offset + HEAD.size <= size:
        record = record_at(records, offset)
        if record.opcode == 0 or record.end > size:
            return
        yield record
        offset = record.end
