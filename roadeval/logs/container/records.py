"""The records of an MCAP file, read strictly: a record that does not add up is refused.

The layouts are those of https://mcap.dev/spec. Schemas, channels and statistics are read by the
`mcap` library. Messages, chunks and indexes are read here, where a length that contradicts another
is an error, and from a few bytes, so that a file can be walked through without reading its data.
"""

from __future__ import annotations

import io
import struct
import sys
from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from mcap import records as mcap_records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode

from roadeval.logs.container.readers import Buffer, ByteReader
from roadeval.logs.errors import BadRecord

MAGIC: Final = b"\x89MCAP0\r\n"
HEAD: Final = struct.Struct("<BQ")
"""Opcode and length, before every record's body."""
MESSAGE_HEAD: Final = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time."""
CHUNK_HEAD: Final = struct.Struct("<QQQII")
"""Start time, end time, uncompressed size, CRC, length of the compression's name."""
CHUNK_INDEX_HEAD: Final = struct.Struct("<QQQQI")
"""Start time, end time, offset and length of the chunk, bytes of its index offsets."""
INDEX_OFFSET: Final = struct.Struct("<HQ")
"""Channel, offset of its message index."""
INDEX_HEAD: Final = struct.Struct("<HI")
"""Channel, bytes of entries."""
LARGEST: Final = 1 << 28
"""Bytes of a message or definition; one that claims more is damaged."""
PRIVATE: Final = 0x80
"""Opcodes from here on belong to applications."""
PADDING: Final = 4
"""A message may be padded at its end to a multiple of so many bytes, as CDR does."""
LONGEST_NAME: Final = 64
"""No compression has a longer name; a chunk that claims so is damaged."""

LONGEST_CHUNK_HEAD: Final = CHUNK_HEAD.size + LONGEST_NAME + 8
"""Bytes of a chunk's body in which its head ends, whatever the compression."""

Entries = npt.NDArray[np.int64]
"""``(n, 2)``: log times of messages, and offsets of their records in the chunk."""


class Place(NamedTuple):
    """A record's place: ``offset`` of its opcode, ``body`` of its content, ``end`` after it."""

    opcode: int
    offset: int
    body: int
    end: int


class Message(NamedTuple):
    """A message as logged; times are nanoseconds."""

    channel_id: int
    sequence: int
    log_time: int
    publish_time: int
    data: memoryview


class Chunk(NamedTuple):
    """A chunk's head: where its compressed data lies and what it claims to hold.

    ``offset`` is the record's, ``data_offset`` and ``data_size`` the compressed data's, all in
    the file; ``size`` and ``crc`` are of the uncompressed records (CRC 0: not given); ``start``
    and ``end`` are the log times of its messages, both closed. ``crc`` is None where it may
    be damaged. A chunk that is ``cut`` continues beyond the end of the file; the head of one that
    is ``repaired`` was damaged, and is taken from the file's summary.
    """

    offset: int
    start: int
    end: int
    size: int
    crc: int | None
    compression: str
    data_offset: int
    data_size: int
    cut: bool = False
    repaired: bool = False


class ChunkIndex(NamedTuple):
    """A chunk in the file's summary: its head without the checksum, and where its record ends.

    ``index_offsets`` are packed pairs of a channel and the offset of its message index.
    """

    chunk: Chunk
    end: int
    index_offsets: bytes

    def has_index_at(self, offset: int) -> bool:
        """Whether one of the chunk's message indexes begins here."""
        return any(offset == at for _, at in INDEX_OFFSET.iter_unpack(self.index_offsets))


class _Strict(ReadDataStream):
    """The library's stream, that refuses a read across the record's end."""

    def read(self, length: int) -> bytes:
        if length > sys.maxsize:
            raise EndOfFile
        data: bytes = super().read(length)
        if len(data) != length:
            raise EndOfFile
        return data


_READERS: Final[dict[int, Callable[[ReadDataStream], Any]]] = {
    Opcode.HEADER: mcap_records.Header.read,
    Opcode.FOOTER: mcap_records.Footer.read,
    Opcode.SCHEMA: mcap_records.Schema.read,
    Opcode.CHANNEL: mcap_records.Channel.read,
    Opcode.MESSAGE_INDEX: mcap_records.MessageIndex.read,
    Opcode.CHUNK_INDEX: mcap_records.ChunkIndex.read,
    Opcode.ATTACHMENT: mcap_records.Attachment.read,
    Opcode.ATTACHMENT_INDEX: mcap_records.AttachmentIndex.read,
    Opcode.STATISTICS: mcap_records.Statistics.read,
    Opcode.METADATA: mcap_records.Metadata.read,
    Opcode.METADATA_INDEX: mcap_records.MetadataIndex.read,
    Opcode.SUMMARY_OFFSET: mcap_records.SummaryOffset.read,
    Opcode.DATA_END: mcap_records.DataEnd.read,
}


def parse(opcode: int, body: Buffer) -> Any:
    """Read a record that is neither message nor chunk, by the `mcap` library.

    Raises
    ------
    BadRecord
        If the body is too short for what its own fields claim, or is not what they say.
    """
    if opcode not in _READERS:
        raise BadRecord(f"a record of unknown kind {opcode}")
    try:
        return _READERS[opcode](_Strict(io.BytesIO(body)))
    except (EndOfFile, struct.error, UnicodeDecodeError) as error:
        raise BadRecord(f"a {Opcode(opcode).name.lower()} record that does not add up") from error


def parse_chunk(place: Place, head: Buffer) -> Chunk:
    """Read a chunk's head from the first bytes of its body.

    The length of its data is what the head says, which may contradict the record's own.

    Raises
    ------
    BadRecord
        If it is no chunk's head.
    """
    if len(head) < CHUNK_HEAD.size:
        raise BadRecord("a chunk without a head")
    start, end, size, crc, name_length = CHUNK_HEAD.unpack_from(head)
    data_offset = CHUNK_HEAD.size + name_length + 8
    if name_length > LONGEST_NAME or len(head) < data_offset:
        raise BadRecord("a chunk whose head is damaged")
    name = bytes(head[CHUNK_HEAD.size : data_offset - 8]).decode("utf-8", "replace")
    (data_size,) = struct.unpack_from("<Q", head, data_offset - 8)
    return Chunk(place.offset, start, end, size, crc, name, place.body + data_offset, data_size)


def parse_chunk_index(body: Buffer) -> ChunkIndex:
    """Read a chunk's index in the summary.

    Raises
    ------
    BadRecord
        If its lengths contradict each other.
    """
    try:
        start, end, offset, length, map_length = CHUNK_INDEX_HEAD.unpack_from(body)
        at = CHUNK_INDEX_HEAD.size + map_length
        _, name_length = struct.unpack_from("<QI", body, at)
        name = bytes(body[at + 12 : at + 12 + name_length]).decode()
        data_size, size = struct.unpack_from("<QQ", body, at + 12 + name_length)
    except (struct.error, UnicodeDecodeError) as error:
        raise BadRecord("a chunk index that does not add up") from error
    data_offset = offset + length - data_size
    head = data_offset - offset - HEAD.size
    if map_length % INDEX_OFFSET.size or head != CHUNK_HEAD.size + name_length + 8:
        raise BadRecord("a chunk index that does not add up")
    chunk = Chunk(offset, start, end, size, None, name, data_offset, data_size)
    return ChunkIndex(chunk, offset + length, bytes(body[CHUNK_INDEX_HEAD.size : at]))


def parse_message_index(body: Buffer) -> tuple[int, Entries]:
    """Read a message index: the channel, and its messages.

    Raises
    ------
    BadRecord
        If its length is not a whole number of entries.
    """
    if len(body) < INDEX_HEAD.size:
        raise BadRecord("a message index without a head")
    channel_id, length = INDEX_HEAD.unpack_from(body)
    if length % 16 or INDEX_HEAD.size + length > len(body):
        raise BadRecord("a message index whose lengths contradict each other")
    entries = np.frombuffer(body, "<i8", length // 8, INDEX_HEAD.size)
    return channel_id, entries.reshape(-1, 2)


def message_at(records: ByteReader, offset: int) -> Message:
    """Read the message whose record begins at ``offset``.

    Raises
    ------
    BadRecord
        If there is no whole message.
    """
    head = records.read(offset, HEAD.size)
    if len(head) < HEAD.size:
        raise BadRecord("no message where the index says")
    opcode, length = HEAD.unpack(head)
    if opcode != Opcode.MESSAGE or not MESSAGE_HEAD.size <= length <= LARGEST:
        raise BadRecord("no message where the index says")
    body = memoryview(records.read(offset + HEAD.size, length))
    if len(body) < length:
        raise BadRecord("a message that is cut off")
    channel_id, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(body)
    return Message(channel_id, sequence, log_time, publish_time, body[MESSAGE_HEAD.size :])


def place_at(records: ByteReader, offset: int) -> Place:
    """Read the head of the record at ``offset``; it may claim to go beyond the end.

    Raises
    ------
    BadRecord
        If not even a head fits in.
    """
    head = records.peek(offset, HEAD.size)
    if len(head) < HEAD.size:
        raise BadRecord("the file is cut off")
    opcode, length = HEAD.unpack(head)
    return Place(opcode, offset, offset + HEAD.size, offset + HEAD.size + length)


def walk(records: ByteReader) -> Iterator[Place]:
    """Yield the places of the records in a chunk, as far as they are whole.

    Zeros end them, too: a million would be as many records of no kind and no length.
    """
    offset = 0
    while offset + HEAD.size <= records.size:
        place = place_at(records, offset)
        if place.opcode == 0 or place.end > records.size:
            return
        yield place
        offset = place.end
