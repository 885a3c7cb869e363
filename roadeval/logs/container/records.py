"""Bytes by position, the records of an MCAP file in them, chunks of records, and the summary.

The layouts are as in https://mcap.dev/spec. The `mcap` library reads most records; messages,
chunks and their indexes are read here from a few bytes, so that a walk through a file does not read
its data. A record with parts that contradict each other raises a `BadRecord`.
"""

from __future__ import annotations

import struct
import sys
import zlib
from collections import OrderedDict
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from io import BytesIO
from tempfile import TemporaryFile
from typing import IO, Any, Final, NamedTuple, cast

import numpy as np
import numpy.typing as npt
from mcap import records as mcap_records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics

from roadeval.logs.errors import BadRecord

MAGIC: Final = b"\x89MCAP0\r\n"
HEAD: Final = struct.Struct("<BQ")
"""Opcode and length, before every record's body."""
MESSAGE_HEAD: Final = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time."""
CHUNK_HEAD: Final = struct.Struct("<QQQII")
"""Start time, end time, uncompressed size, CRC, length of the compression's name."""
CHUNK_BEGIN: Final = HEAD.size + CHUNK_HEAD.size + 64 + 8 + 4
"""Bytes of a chunk that hold its head; the name of a compression has at most 64, or is damaged."""
LARGEST: Final = 1 << 28
"""Bytes of a message or definition; one that claims more is damaged."""
DEFINITIONS: Final = (Opcode.SCHEMA, Opcode.CHANNEL)
CHUNK, MESSAGE, MESSAGE_INDEX = Opcode.CHUNK, Opcode.MESSAGE, Opcode.MESSAGE_INDEX
"""Opcodes that each record is compared with; a look-up in the enumeration is ten times slower."""
COMPRESSIONS: Final = ("", "zstd", "lz4")
_MAGIC: Final = {b"\x28\xb5\x2f\xfd": "zstd", b"\x04\x22\x4d\x18": "lz4"}
PRIVATE: Final = 0x80
"""Opcodes from here on belong to applications."""
PADDING: Final = 4
"""A message may be padded at its end to a multiple of this many bytes, as CDR does."""
_EXTENSION: Final = 64
"""Bytes that a later version of the format may add to a record; one with more is damaged."""

BUFFER: Final = 16 << 10
"""Bytes that are read at once while walking from record to record."""
BLOCK: Final = 1 << 20
"""Bytes that are read or uncompressed at a time."""
LARGEST_CHUNK: Final = 1 << 30
"""Most uncompressed bytes of a chunk: a few compressed bytes can become any number."""
IN_MEMORY: Final = 16 << 20
"""A chunk of more bytes is held in a temporary file; writers make chunks of about a megabyte."""
CACHE: Final = 16 << 20
"""Bytes of uncompressed chunks in memory: topics that are read side by side share chunks."""
DOUBTED: Final = 256 << 20
"""Bytes that may be tried in vain in a search for records; every byte of the file adds four."""

Buffer = bytes | memoryview
Entries = npt.NDArray[np.int64]
"""``(n, 2)``: log times of messages, and offsets of their records in the chunk."""


class FarFile:
    """An open remote file, for which several requests take no longer than one."""

    def expect(self, parts: Iterable[tuple[int, int]]) -> None:
        """Begin to read the parts that are needed next, each from a byte up to another."""
        raise NotImplementedError


class FileBytes:
    """A part of a file, sliced like `bytes`; a `BadRecord` if the disk fails.

    The file is not mapped: mapped pages count as memory of the program, and a file that shrinks
    while it is read would end the program with a bus error.
    """

    def __init__(self, file: IO[bytes], begin: int = 0, size: int | None = None) -> None:
        self._file = file
        self.begin = begin
        self._size = file.seek(0, 2) - begin if size is None else size
        self._at = 0

    def part(self, begin: int, end: int) -> FileBytes:
        """Return a part of this part."""
        return FileBytes(self._file, self.begin + begin, end - begin)

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, part: slice, /) -> bytes:
        start, stop = part.start, min(part.stop, self._size)
        if start >= stop:
            return b""
        try:
            self._file.seek(self.begin + start)
            return self._file.read(stop - start)
        except OSError as error:
            raise BadRecord(f"unreadable on its disk ({error.strerror})") from error

    def read(self, size: int) -> bytes:
        """Return the next bytes, as a file does; the last byte alone, so that `left` shows it."""
        data = self[self._at : self._at + max(min(size, self.left - 1), 1)]
        self._at += len(data)
        return data

    @property
    def left(self) -> int:
        """Bytes that were not read."""
        return self._size - self._at

    def expect(self, parts: Iterable[tuple[int, int]]) -> None:
        """Announce the parts that are read next, in this order, so that a `FarFile` reads ahead.

        Each is a first byte and the byte behind its last.
        """
        if isinstance(self._file, FarFile):
            self._file.expect((self.begin + begin, self.begin + end) for begin, end in parts)

    def close(self) -> None:
        """Close the file."""
        self._file.close()


Bytes = FileBytes | memoryview
"""Bytes in memory, or in a file."""


class Record(NamedTuple):
    """A record: ``offset`` of its opcode, ``body`` of its content, ``end`` after it."""

    opcode: int
    offset: int
    body: int
    end: int
    content: Any = None
    """Its fields, if they were read."""


class Message(NamedTuple):
    """A message as logged; times are nanoseconds."""

    channel_id: int
    sequence: int
    log_time: int
    publish_time: int
    data: memoryview


class Chunk(NamedTuple):
    """A chunk's head: the place of its data in the file, and the content that it claims."""

    offset: int
    start: int
    end: int
    """Log times of its first and its last message."""
    size: int
    """Bytes of its uncompressed records."""
    crc: int
    """Checksum of the uncompressed records; 0 if there is none."""
    compression: str
    data_offset: int
    data_size: int
    proven: bool = False
    """Whether its checksum or the summary confirms its place and length."""
    cut: bool = False
    """Whether it continues beyond the end of the file."""
    repaired: bool = False
    """Whether its head is damaged, and its length or kind follows from other bytes."""

    @property
    def data_end(self) -> int:
        """The byte of the file at which its data ends."""
        return self.data_offset + self.data_size

    @property
    def record(self) -> Record:
        """The chunk as a record."""
        return Record(CHUNK, self.offset, self.offset + HEAD.size, self.data_end, self)


class _Strict(ReadDataStream):
    """A stream of the library that refuses to read beyond the record's end."""

    def read(self, length: int) -> bytes:
        data: bytes = super().read(length) if length <= sys.maxsize else b""
        if len(data) != length:
            raise EndOfFile
        return data


def parse(opcode: int, body: Buffer) -> Any:
    """Read a record with the `mcap` library; it is neither a message nor a chunk."""
    try:
        name = Opcode(opcode).name
    except ValueError as error:
        raise BadRecord(f"a record of unknown kind {opcode}") from error
    stream = BytesIO(body)
    with suppress(EndOfFile, struct.error, UnicodeDecodeError):
        record = getattr(mcap_records, name.title().replace("_", "")).read(_Strict(stream))
        if len(body) - stream.tell() <= _EXTENSION:
            return record
    raise BadRecord(f"a {name.lower()} record that does not add up")


def parse_chunk(source: Bytes, record: Record) -> Chunk:
    """Read a chunk's head; its length of the data may contradict the length of the record."""
    head = source[record.body : record.body - HEAD.size + CHUNK_BEGIN]
    with suppress(struct.error):
        start, end, size, crc, name_length = CHUNK_HEAD.unpack_from(head)
        at = CHUNK_HEAD.size + name_length
        (data_size,) = struct.unpack_from("<Q", head, at)
        name = bytes(head[CHUNK_HEAD.size : at]).decode("utf-8", "replace")
        if name not in COMPRESSIONS:  # it is damaged, but the data shows its own compression
            name = _MAGIC.get(bytes(head[at + 8 : at + 12]), name)
        return Chunk(record.offset, start, end, size, crc, name, record.body + at + 8, data_size)
    raise BadRecord("a chunk without a head")


def parse_message_index(body: Buffer) -> tuple[int, Entries]:
    """Read a message index: the channel, and its messages."""
    # The library makes a tuple of each message, which takes a thousand times as long.
    channel_id, length = struct.unpack_from("<HI", body) if len(body) >= 6 else (0, 1)
    if length % 16 or not 0 <= len(body) - 6 - length <= _EXTENSION:
        raise BadRecord("a message index whose lengths contradict each other")
    return channel_id, np.frombuffer(bytes(body[6 : 6 + length]), "<i8").reshape(-1, 2)


def message_at(records: Bytes, offset: int) -> Message:
    """Read the message with the record at ``offset``."""
    opcode, _, begin, end, _ = record_at(records, offset)
    if opcode != MESSAGE or not MESSAGE_HEAD.size <= end - begin <= LARGEST:
        raise BadRecord("no message where the index says")
    body = memoryview(records[begin:end])
    if len(body) < end - begin:
        raise BadRecord("a message that is cut off")
    channel_id, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(body)
    return Message(channel_id, sequence, log_time, publish_time, body[MESSAGE_HEAD.size :])


def record_at(records: Bytes, offset: int) -> Record:
    """Read the head of the record at ``offset``; the record may claim to go beyond the end."""
    head = records[offset : offset + HEAD.size]
    if len(head) < HEAD.size:
        raise BadRecord("the file is cut off")
    opcode, length = HEAD.unpack(head)
    return Record(opcode, offset, offset + HEAD.size, offset + HEAD.size + length)


def walk(records: Bytes) -> Iterator[Record]:
    """Yield the complete records of a chunk, up to the first zeros, which are not records."""
    offset, size = 0, len(records)
    while offset + HEAD.size <= size:
        record = record_at(records, offset)
        if record.opcode == 0 or record.end > size:
            return
        yield record
        offset = record.end


class ChunkReader:
    """Reads the chunks of a file, the last few from memory."""

    def __init__(self, source: FileBytes) -> None:
        self._source = source
        self._cache: OrderedDict[int, Bytes] = OrderedDict()
        self.patience = DOUBTED + 4 * len(source)
        """Bytes that may still be uncompressed in vain; below 0 no chunk is proven."""
        self.bad: dict[int, str] = {}
        """Reasons why chunks could not be read, by their offsets."""
        self.flawed: dict[int, str] = {}
        """The damage of chunks that could still be read, by their offsets."""

    def read(self, chunk: Chunk) -> Bytes:
        """Read the records of a chunk, or those before the cut if it is cut off."""
        at = chunk.offset
        if at in self.bad:
            raise BadRecord(self.bad[at])
        if at not in self._cache:
            try:
                self._remember(at, self.remains(chunk) if chunk.cut else self._verified(chunk))
            except BadRecord as error:
                self.bad[at] = str(error)
                raise
        self._cache.move_to_end(at)
        return self._cache[at]

    def remains(self, chunk: Chunk) -> Bytes:
        """Uncompress a chunk as far as possible."""
        return self._uncompress(chunk, LARGEST_CHUNK, whole=False)

    def proof(self, chunk: Chunk) -> Chunk | None:
        """Return the chunk as proven if its content has its checksum, even if its head is wrong.

        Without a checksum it must consist of complete records, of the size that its head claims.
        None if it is not proven, or if too many wrong chunks were tried.
        """
        left = len(self._source) - chunk.data_offset
        if (chunk.size or chunk.crc) and 0 < chunk.data_size <= left and self.patience >= 0:
            # If the head claims a wrong size, compression by more than 64 is not likely.
            most = max(chunk.size, 64 * chunk.data_size) if chunk.crc else chunk.size
            with suppress(BadRecord):
                records = self._uncompress(chunk, most, whole=True)
                size = len(records)
                if chunk.crc:
                    is_proven = crc_of(records) == chunk.crc
                else:
                    ends = (record.end for record in walk(records))
                    is_proven = size == chunk.size == max(ends, default=0)
                if is_proven:
                    self._remember(chunk.offset, records)
                    return chunk._replace(size=size, proven=True)
                self.patience -= size
            self.patience -= chunk.data_size
        return None

    def _verified(self, chunk: Chunk) -> Bytes:
        records = self._uncompress(chunk, chunk.size, whole=True)
        if len(records) < chunk.size:
            raise BadRecord(f"a chunk of {len(records)} bytes that claims to hold {chunk.size}")
        if chunk.crc and crc_of(records) != chunk.crc:
            raise BadRecord("a chunk whose checksum is wrong")
        return records

    def _uncompress(self, chunk: Chunk, most: int, *, whole: bool) -> Bytes:
        if chunk.compression == "" and whole and chunk.data_size > IN_MEMORY:
            return self._source.part(chunk.data_offset, chunk.data_end)
        patience, most = self.patience, min(most, LARGEST_CHUNK)
        file: IO[bytes] = BytesIO()
        try:
            for block in blocks(self._source, chunk):
                self.patience -= len(block)
                if file.tell() + len(block) > most:
                    raise BadRecord(f"a chunk of more than {most} bytes")
                if isinstance(file, BytesIO) and file.tell() + len(block) > IN_MEMORY:
                    memory = file.getvalue()
                    file = cast("IO[bytes]", TemporaryFile())  # noqa: SIM115
                    file.write(memory)
                file.write(block)
        except BadRecord:
            if whole:
                raise
        self.patience = patience
        # Not `getbuffer`: Python 3.13 prints an error if a cycle with it is collected.
        return memoryview(file.getvalue()) if isinstance(file, BytesIO) else FileBytes(file)

    def _remember(self, offset: int, records: Bytes) -> None:
        self._cache[offset] = records
        size = sum(map(len, self._cache.values()))
        while (size > CACHE and len(self._cache) > 2) or len(self._cache) > 64:
            size -= len(self._cache.popitem(last=False)[1])


def crc_of(records: Bytes) -> int:
    """Compute the CRC-32 of bytes."""
    crc = 0
    for offset in range(0, len(records), BLOCK):
        crc = zlib.crc32(records[offset : offset + BLOCK], crc)
    return crc


def blocks(source: FileBytes, chunk: Chunk) -> Iterator[bytes]:
    """Uncompress a chunk into blocks of a bounded size."""
    import zstandard

    data = source.part(chunk.data_offset, chunk.data_end)
    try:
        if chunk.compression == "zstd":
            stream = cast("IO[bytes]", data)
            yield from zstandard.ZstdDecompressor().read_to_iter(stream, BLOCK, BLOCK)
        elif chunk.compression == "lz4":
            import lz4.frame

            frame = lz4.frame.LZ4FrameDecompressor()
            while not frame.eof:
                block = data.read(BLOCK) if frame.needs_input else b""
                if frame.needs_input and not block:
                    break
                yield frame.decompress(block, BLOCK)
        elif chunk.compression == "":
            yield from iter(partial(data.read, BLOCK), b"")
        else:
            raise BadRecord(f"a chunk compressed by {chunk.compression!r}, which is unknown")
    except (zstandard.ZstdError, RuntimeError) as error:
        raise BadRecord(f"a chunk that {chunk.compression} cannot uncompress") from error
    if data.left:
        raise BadRecord("a chunk that claims more bytes than its data has")


_FOOTER_SIZE: Final = HEAD.size + 20 + len(MAGIC)


@dataclass(slots=True)
class Summary:
    """The contents of the summary; it is empty if the summary is not reliable."""

    start: int | None = None
    """The byte at which it should begin, by the footer; None if the footer is missing."""
    checked: bool = False
    """Whether it has a checksum, which is right."""
    problem: str = ""
    """Why it is not reliable."""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: dict[int, Chunk] = field(default_factory=dict)
    """The chunks' heads without their checksums, by offset."""
    index_ends: dict[int, int] = field(default_factory=dict)
    """The byte at which a chunk's message indexes end, by the chunk's offset."""
    maps: dict[int, Buffer] = field(default_factory=dict)
    """The channels of a chunk and the offsets of their message indexes, packed, likewise."""
    statistics: Statistics | None = None

    def fill(self, records: memoryview) -> None:
        """Read the records of the summary, or raise a `BadRecord`."""
        end = 0
        for opcode, _, body, end, _ in walk(records):
            if opcode == Opcode.CHUNK_INDEX:
                self._list_chunk(records[body:end])
            elif opcode in DEFINITIONS:
                record = parse(opcode, records[body:end])
                (self.schemas if opcode == Opcode.SCHEMA else self.channels)[record.id] = record
            elif opcode == Opcode.STATISTICS:
                self.statistics = parse(opcode, records[body:end])
            elif opcode in (Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX, Opcode.SUMMARY_OFFSET):
                parse(opcode, records[body:end])  # they are only checked
            elif opcode < PRIVATE:
                raise BadRecord("its summary is not where it should be")
        if end != len(records):
            raise BadRecord("its summary does not add up")

    def _list_chunk(self, body: Buffer) -> None:
        """Read a chunk index, but not its map: the library makes an object of each entry of it."""
        with suppress(struct.error, UnicodeDecodeError):
            start, end, offset, length, map_size = struct.unpack_from("<QQQQI", body)
            indexes, name_length = struct.unpack_from("<QI", body, 36 + map_size)
            at = 48 + map_size
            name = bytes(body[at : at + name_length]).decode()
            data_size, size = struct.unpack_from("<QQ", body, at + name_length)
            data_at = offset + HEAD.size + CHUNK_HEAD.size + name_length + 8
            if data_at + data_size == offset + length:
                chunk = Chunk(offset, start, end, size, 0, name, data_at, data_size)
                self.chunks[offset], self.index_ends[offset] = chunk, offset + length + indexes
                self.maps[offset] = body[36 : 36 + map_size]
                return
        raise BadRecord("a chunk index that does not add up")

    def channels_in(self, offset: int) -> list[int]:
        """Return the channels of a chunk that has message indexes."""
        packed = self.maps[offset]
        if len(packed) % 10:
            raise BadRecord("a chunk index that does not add up")
        channels: list[int] = np.frombuffer(packed, "<u2, <u8")["f0"].tolist()
        return channels


def read_summary(source: Bytes) -> Summary:
    """Read the summary, and check whether it is reliable."""
    end = len(source) - _FOOTER_SIZE
    tail = bytes(source[max(end, 0) : len(source)])
    if len(tail) < _FOOTER_SIZE or tail[0] != Opcode.FOOTER or not tail.endswith(MAGIC):
        return Summary(problem="the file does not end as it should")
    footer = parse(Opcode.FOOTER, tail[HEAD.size : -len(MAGIC)])
    if footer.summary_start == 0:
        return Summary(end)
    summary = Summary(footer.summary_start, footer.summary_crc != 0)
    try:
        if not 0 <= end - footer.summary_start <= LARGEST:
            raise BadRecord("its summary is not where it should be")
        records = memoryview(source[footer.summary_start : end])
        # The checksum covers the summary and the footer up to the checksum itself.
        crc = zlib.crc32(tail[: HEAD.size + 16], zlib.crc32(records))
        if summary.checked and crc != footer.summary_crc:
            raise BadRecord("the checksum of its summary is wrong")
        summary.fill(records)
    except BadRecord as error:
        return Summary(footer.summary_start, problem=str(error))
    return summary
