"""The records of an MCAP file, read strictly: a record that does not add up is refused.

The layouts are those of https://mcap.dev/spec. Records that are met once (schemas, channels,
statistics) are read by the `mcap` library; those met a thousand times a second are read here,
from a few bytes and without a copy.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from mcap import records as mcap_records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode

Buffer = bytes | memoryview

MAGIC: Final = b"\x89MCAP0\r\n"
HEAD: Final = struct.Struct("<BQ")
"""Opcode and length, before every record's body."""
MESSAGE_HEAD: Final = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time."""
CHUNK_HEAD: Final = struct.Struct("<QQQII")
"""Start time, end time, uncompressed size, CRC, length of the compression's name."""
INDEX_HEAD: Final = struct.Struct("<HI")
"""Channel, bytes of entries."""
LONGEST_NAME: Final = 64
"""No compression has a longer name; a chunk that claims so is damaged."""


class BadRecord(Exception):  # noqa: N818  (never leaves this room)
    """A record whose parts contradict each other."""


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


@dataclass(frozen=True, slots=True)
class Chunk:
    """A chunk's head: where its compressed data lies and what it claims to hold.

    ``offset`` is the record's, ``data_offset`` and ``data_size`` the compressed data's, all in
    the file; ``size`` and ``crc`` are of the uncompressed records (CRC 0: not given); ``start``
    and ``end`` are the log times of its messages, both closed.
    """

    offset: int
    start: int
    end: int
    size: int
    crc: int
    compression: str
    data_offset: int
    data_size: int


class _Strict(ReadDataStream):
    """The library's stream, that refuses a read across the record's end."""

    def read(self, length: int) -> bytes:
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
    try:
        return _READERS[opcode](_Strict(io.BytesIO(body)))
    except (EndOfFile, struct.error, UnicodeDecodeError) as error:
        raise BadRecord(f"a {Opcode(opcode).name.lower()} record that does not add up") from error


def parse_chunk(place: Place, head: Buffer) -> Chunk:
    """Read a chunk's head from the first bytes of its body.

    Raises
    ------
    BadRecord
        If the lengths inside contradict the record's own.
    """
    if len(head) < CHUNK_HEAD.size:
        raise BadRecord("a chunk without a head")
    start, end, size, crc, name_length = CHUNK_HEAD.unpack_from(head)
    data_offset = CHUNK_HEAD.size + name_length + 8
    if name_length > LONGEST_NAME or len(head) < data_offset:
        raise BadRecord("a chunk whose compression has no name")
    name = bytes(head[CHUNK_HEAD.size : data_offset - 8])
    (data_size,) = struct.unpack_from("<Q", head, data_offset - 8)
    if place.body + data_offset + data_size != place.end:
        raise BadRecord("a chunk whose lengths contradict each other")
    compression = name.decode("utf-8", "replace")
    return Chunk(
        place.offset, start, end, size, crc, compression, place.body + data_offset, data_size
    )


def parse_message_index(body: Buffer) -> tuple[int, npt.NDArray[np.int64]]:
    """Read a message index: the channel, and ``(n, 2)`` log times and offsets in the chunk.

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


def message_at(records: Buffer, offset: int) -> Message:
    """Read the message whose record begins at ``offset``, without a copy.

    Raises
    ------
    BadRecord
        If there is no whole message.
    """
    body = offset + HEAD.size
    if offset < 0 or body + MESSAGE_HEAD.size > len(records):
        raise BadRecord("a message beyond the end")
    opcode, length = HEAD.unpack_from(records, offset)
    if opcode != Opcode.MESSAGE or not MESSAGE_HEAD.size <= length <= len(records) - body:
        raise BadRecord("no message where the index says")
    data = memoryview(records)[body + MESSAGE_HEAD.size : body + length]
    channel_id, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(records, body)
    return Message(channel_id, sequence, log_time, publish_time, data)


def walk(records: Buffer) -> Iterator[Place]:
    """Yield the places of the whole records in a chunk's uncompressed bytes.

    Raises
    ------
    BadRecord
        At the first one that is cut off.
    """
    offset, size = 0, len(records)
    while offset < size:
        if offset + HEAD.size > size:
            raise BadRecord(f"a record cut off at byte {offset} of its chunk")
        opcode, length = HEAD.unpack_from(records, offset)
        end = offset + HEAD.size + length
        if end > size:
            raise BadRecord(f"a record cut off at byte {offset} of its chunk")
        yield Place(opcode, offset, offset + HEAD.size, end)
        offset = end
