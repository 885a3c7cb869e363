"""The summary at the end of an MCAP file, which repeats much of what lies before it."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, Footer, Schema, Statistics

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
_DATA_END: Final = HEAD.pack(Opcode.DATA_END, 4)
_NEAR: Final = 16 << 20
"""Bytes at the file's end among which a summary is looked for that is not in its place."""
_TRIES: Final = 16
"""Places that are tried; more than one is there only if messages hold such bytes."""


@dataclass(slots=True)
class Summary:
    """The contents of the summary; nothing where it cannot be relied on."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: dict[int, Chunk] = field(default_factory=dict)
    """The chunks' heads but for their checksums, by offset."""
    index_ends: dict[int, int] = field(default_factory=dict)
    """Where the message indexes of a chunk end, by the chunk's offset."""
    attachments: dict[int, int] = field(default_factory=dict)
    """Where attachments begin and end."""
    statistics: Statistics | None = None
    start: int | None = None
    """Where it should begin, and the data end, as the file's end says; None if that is missing."""
    checked: bool = False
    """Whether its checksum is given, and right."""
    moved: int = 0
    """By how many bytes it lies further back than it should; negative where bytes are missing."""
    problem: str = ""
    """Why it cannot be relied on, or that it is not in its place."""

    @property
    def in_place(self) -> bool:
        """Whether its checksum is right where it should be, so that its offsets hold."""
        return self.checked and not self.moved

    def fill(self, body: memoryview) -> None:
        """Take in the records of the summary, or raise `BadRecord`."""
        end = 0
        for record in walk(body):
            end = record.end
            said = body[record.body : end]
            if record.opcode == Opcode.CHUNK_INDEX:
                chunk, index_end = _parse_chunk_index(said)
                self.chunks[chunk.offset], self.index_ends[chunk.offset] = chunk, index_end
            elif record.opcode in SUMMARY_RECORDS:
                self._take(parse(record.opcode, said))
            elif record.opcode < PRIVATE:
                raise BadRecord("its summary is not where it should be")
        if end != len(body):
            raise BadRecord("its summary does not add up")

    def _take(self, record: Any) -> None:
        if isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record
        elif isinstance(record, AttachmentIndex):
            self.attachments[record.offset] = record.offset + record.length
        elif isinstance(record, Statistics):
            self.statistics = record


def read_summary(source: Bytes) -> Summary:
    """Read the summary, if it can be relied on, wherever before the file's end it lies."""
    footer_at = len(source) - _FOOTER_SIZE
    tail = bytes(source[max(footer_at, 0) : len(source)])
    if len(tail) < _FOOTER_SIZE or tail[0] != Opcode.FOOTER or not tail.endswith(MAGIC):
        return Summary(problem="the file does not end as it should")
    footer: Footer = parse(Opcode.FOOTER, tail[HEAD.size : -len(MAGIC)])
    if footer.summary_start == 0:
        return Summary(start=footer_at)
    problem = ""
    for start in _starts(source, footer.summary_start, footer_at):
        found = Summary(start=footer.summary_start, checked=footer.summary_crc != 0)
        found.moved = start - footer.summary_start
        found.problem = "its summary is not where it should be" if found.moved else ""
        try:
            found.fill(_checked(source, start, footer_at, footer.summary_crc, tail[:_CHECKED]))
        except BadRecord as error:
            problem = problem or str(error)
        else:
            return found
    return Summary(start=footer.summary_start, problem=problem)


def _starts(source: Bytes, start: int, footer_at: int) -> Iterator[int]:
    """Yield where the summary may begin: where the footer says, or behind an end of the data."""
    yield start
    near = max(footer_at - _NEAR, 0)
    before = bytes(source[near:footer_at])
    at = len(before)
    for _ in range(_TRIES):
        at = before.rfind(_DATA_END, 0, at)
        if at < 0:
            return
        yield near + at + len(_DATA_END) + 4


def _checked(source: Bytes, start: int, end: int, crc: int, footer: bytes) -> memoryview:
    if not 0 <= end - start <= LARGEST:
        raise BadRecord("its summary is not where it should be")
    body = memoryview(source[start:end])
    if crc and zlib.crc32(footer, zlib.crc32(body)) != crc:
        raise BadRecord("the checksum of its summary is wrong")
    return body


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
