"""The summary at the end of an MCAP file, which repeats much of what lies before it."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from typing import Final

from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics

from roadeval.logs.container.records import (
    CHUNK_HEAD,
    HEAD,
    LARGEST,
    MAGIC,
    PRIVATE,
    Buffer,
    Bytes,
    Chunk,
    parse,
    walk,
)
from roadeval.logs.errors import BadRecord

SUMMARY_RECORDS: Final = (
    *(Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX),
    *(Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX, Opcode.SUMMARY_OFFSET),
)
"""The records that can stand in a summary."""
_FOOTER_SIZE: Final = HEAD.size + 20 + len(MAGIC)
_CHECKED: Final = HEAD.size + 16
"""Bytes of the footer that its own checksum covers."""
_CHUNK_INDEX: Final = struct.Struct("<QQQQI")
"""Start time, end time, offset and length of the chunk, bytes of the map of its indexes."""


@dataclass(slots=True)
class Summary:
    """The contents of the summary; nothing where it cannot be relied on."""

    start: int | None = None
    """Where it should begin, and the data end, as the file's end says; None if that is missing."""
    checked: bool = False
    """Whether its checksum is given, and right."""
    problem: str = ""
    """Why it cannot be relied on."""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: dict[int, Chunk] = field(default_factory=dict)
    """The chunks' heads but for their checksums, by offset."""
    index_ends: dict[int, int] = field(default_factory=dict)
    """Where the message indexes of a chunk end, by the chunk's offset."""
    statistics: Statistics | None = None

    def fill(self, records: memoryview) -> None:
        """Take in the records of the summary, or raise `BadRecord`."""
        end = 0
        for opcode, _, body, end, _ in walk(records):
            if opcode == Opcode.CHUNK_INDEX:
                chunk, index_end = _parse_chunk_index(records[body:end])
                self.chunks[chunk.offset], self.index_ends[chunk.offset] = chunk, index_end
            elif opcode in SUMMARY_RECORDS:
                record = parse(opcode, records[body:end])
                if opcode == Opcode.SCHEMA:
                    self.schemas[record.id] = record
                elif opcode == Opcode.CHANNEL:
                    self.channels[record.id] = record
                elif opcode == Opcode.STATISTICS:
                    self.statistics = record
            elif opcode < PRIVATE:
                raise BadRecord("its summary is not where it should be")
        if end != len(records):
            raise BadRecord("its summary does not add up")


def read_summary(source: Bytes) -> Summary:
    """Read the summary, if it can be relied on."""
    end = len(source) - _FOOTER_SIZE
    tail = bytes(source[max(end, 0) : len(source)])
    if len(tail) < _FOOTER_SIZE or tail[0] != Opcode.FOOTER or not tail.endswith(MAGIC):
        return Summary(problem="the file does not end as it should")
    footer = parse(Opcode.FOOTER, tail[HEAD.size : -len(MAGIC)])
    if footer.summary_start == 0:
        return Summary(end)
    found = Summary(footer.summary_start, footer.summary_crc != 0)
    try:
        if not 0 <= end - footer.summary_start <= LARGEST:
            raise BadRecord("its summary is not where it should be")
        records = memoryview(source[footer.summary_start : end])
        if found.checked and zlib.crc32(tail[:_CHECKED], zlib.crc32(records)) != footer.summary_crc:
            raise BadRecord("the checksum of its summary is wrong")
        found.fill(records)
    except BadRecord as error:
        return Summary(footer.summary_start, problem=str(error))
    return found


def _parse_chunk_index(body: Buffer) -> tuple[Chunk, int]:
    """Read a chunk's head, but for its checksum, and where its message indexes end.

    Unlike the library, which takes long for the map of these.
    """
    try:
        start, end, offset, length, map_length = _CHUNK_INDEX.unpack_from(body)
        at = _CHUNK_INDEX.size + map_length
        index_length, name_length = struct.unpack_from("<QI", body, at)
        name = bytes(body[at + 12 : at + 12 + name_length]).decode()
        data_size, size = struct.unpack_from("<QQ", body, at + 12 + name_length)
    except (struct.error, UnicodeDecodeError) as error:
        raise BadRecord("a chunk index that does not add up") from error
    data_offset = offset + HEAD.size + CHUNK_HEAD.size + name_length + 8
    if data_offset + data_size != offset + length:
        raise BadRecord("a chunk index that does not add up")
    chunk = Chunk(offset, start, end, size, None, name, data_offset, data_size)
    return chunk, offset + length + index_length
