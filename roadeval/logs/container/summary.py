"""The summary at the end of an MCAP file, which repeats much of what lies before it."""

from __future__ import annotations

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
_MAP: Final = 32
"""Where a chunk index has the map of the chunk's message indexes: its length, then its bytes."""


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

    The map of these is left out: the library takes long for it.
    """
    map_length = int.from_bytes(body[_MAP : _MAP + 4], "little")
    index = parse(
        Opcode.CHUNK_INDEX, b"".join((body[:_MAP], bytes(4), body[_MAP + 4 + map_length :]))
    )
    offset, name, data_size = index.chunk_start_offset, index.compression, index.compressed_size
    end = offset + index.chunk_length
    if end != offset + HEAD.size + CHUNK_HEAD.size + len(name.encode()) + 8 + data_size:
        raise BadRecord("a chunk index that does not add up")
    times, size = (index.message_start_time, index.message_end_time), index.uncompressed_size
    chunk = Chunk(offset, *times, size, None, name, end - data_size, data_size)
    return chunk, end + index.message_index_length
