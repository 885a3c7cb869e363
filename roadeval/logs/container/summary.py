"""The summary at the end of an MCAP file, which repeats much of what lies before it."""

from __future__ import annotations

import zlib
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Final

from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Schema, Statistics

from roadeval.logs.container.chunks import crc_of
from roadeval.logs.container.readers import FileReader, PartReader
from roadeval.logs.container.records import (
    HEAD,
    LARGEST,
    MAGIC,
    PRIVATE,
    ChunkIndex,
    parse,
    parse_chunk_index,
    walk,
)
from roadeval.logs.errors import BadRecord

FOOTER_SIZE: Final = HEAD.size + 20 + len(MAGIC)
SUMMARY_RECORDS: Final = (
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.STATISTICS,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
    Opcode.SUMMARY_OFFSET,
)
"""The records that can stand in a summary."""
_KEPT: Final = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.CHUNK_INDEX, Opcode.STATISTICS)
_CHECKED: Final = HEAD.size + 16
"""Bytes of the footer that its own checksum covers."""


@dataclass(frozen=True, slots=True)
class Summary:
    """The contents of the summary.

    Attributes
    ----------
    chunks
        Chunk indexes by the offset of their chunk.
    start
        Where it begins, and the data ends, as the end of the file says; None if that is missing.
    checked
        Whether its checksum is given, and right.
    problem
        Why the summary cannot be relied on, or empty. Then all else is empty, but for ``start`` and
        for what `statistics_after` finds.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: dict[int, ChunkIndex] = field(default_factory=dict)
    statistics: Statistics | None = None
    start: int | None = None
    checked: bool = False
    problem: str = ""


def read_summary(source: FileReader) -> Summary:
    """Read the summary, if it can be relied on."""
    footer_at = source.size - FOOTER_SIZE
    tail = source.read(max(footer_at, 0), FOOTER_SIZE)
    if len(tail) < FOOTER_SIZE or not tail.endswith(MAGIC) or tail[0] != Opcode.FOOTER:
        return Summary(problem="the file does not end as it should")
    footer: Footer = parse(Opcode.FOOTER, tail[HEAD.size : -len(MAGIC)])
    if footer.summary_start == 0:
        return Summary(start=footer_at)
    try:
        found = _collect(_checked(source, footer, tail[:_CHECKED]))
    except BadRecord as error:
        return Summary(start=footer.summary_start, problem=str(error))
    return replace(found, start=footer.summary_start, checked=footer.summary_crc != 0)


def statistics_after(source: FileReader, offset: int) -> Statistics | None:
    """Find the counts of messages among the records behind the data, whose checksum is wrong."""
    part = PartReader(source, offset, source.size - offset)
    with suppress(BadRecord):
        for place in walk(part):
            if place.opcode == Opcode.STATISTICS:
                found: Statistics = parse(
                    place.opcode, part.peek(place.body, place.end - place.body)
                )
                return found
    return None


def _checked(source: FileReader, footer: Footer, head: bytes) -> PartReader:
    """Return the part of the file where the footer says the summary is, its checksum verified."""
    size = source.size - FOOTER_SIZE - footer.summary_start
    if not 0 <= size <= LARGEST:
        raise BadRecord("its summary is not where it should be")
    part = PartReader(source, footer.summary_start, size)
    if footer.summary_crc and zlib.crc32(head, crc_of(part)) != footer.summary_crc:
        raise BadRecord("the checksum of its summary is wrong")
    return part


def _collect(part: PartReader) -> Summary:
    summary, statistics, end = Summary(), None, 0
    for place in walk(part):
        end = place.end
        if place.opcode not in SUMMARY_RECORDS and place.opcode < PRIVATE:
            raise BadRecord("its summary is not where it should be")
        if place.opcode not in _KEPT:
            continue
        body = part.peek(place.body, place.end - place.body)
        if place.opcode == Opcode.CHUNK_INDEX:
            index = parse_chunk_index(body)
            summary.chunks[index.chunk.offset] = index
            continue
        record = parse(place.opcode, body)
        if isinstance(record, Schema):
            summary.schemas[record.id] = record
        elif isinstance(record, Channel):
            summary.channels[record.id] = record
        else:
            statistics = record
    if end != part.size:
        raise BadRecord("its summary does not add up")
    return replace(summary, statistics=statistics)
