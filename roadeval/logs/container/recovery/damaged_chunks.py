"""Chunks that are damaged or cut off, as a recorder that was killed leaves its last one.

A chunk gives its length twice, and the file's summary a third time: the functions here decide which
is right, and read the records that are left.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from roadeval.logs.container.compression import Spool
from roadeval.logs.container.readers import ByteReader
from roadeval.logs.container.records import (
    CHUNK_HEAD,
    Chunk,
    ChunkIndex,
    Entries,
    Place,
    parse_chunk,
)
from roadeval.logs.errors import BadRecord


def by_own_head(
    place: Place, head: bytes, file_size: int, is_likely: Callable[[int], bool]
) -> Chunk:
    """Read a chunk by its own head, which gives its length twice.

    Where the two differ, the one is used after which a record is likely to begin; where
    both lie beyond the end of the file, the chunk is cut off.

    Raises
    ------
    BadRecord
        If it is no chunk's head, or neither length can be.
    """
    chunk = parse_chunk(place, head)
    end = chunk.data_offset + chunk.data_size
    if end != place.end and is_likely(end):
        return chunk
    if end != place.end and is_likely(place.end):
        return chunk._replace(data_size=place.end - chunk.data_offset)
    if min(end, place.end) > file_size >= chunk.data_offset:
        return chunk._replace(data_size=file_size - chunk.data_offset, cut=True)
    if end != place.end:
        raise BadRecord("a chunk whose lengths contradict each other")
    return chunk


def by_summary(place: Place, head: bytes, index: ChunkIndex) -> Chunk:
    """Read a chunk as the summary describes it; its own head gives the checksum."""
    with suppress(BadRecord):
        own = parse_chunk(place, head)
        if own._replace(crc=None) == index.chunk:
            return own
    crc = CHUNK_HEAD.unpack_from(head)[3] if len(head) >= CHUNK_HEAD.size else 0
    return index.chunk._replace(crc=crc or None, repaired=True)


def is_within(entries: Entries, chunk: Chunk) -> bool:
    """Whether a message index agrees with its chunk's head."""
    if not len(entries):
        return True
    times, offsets = entries[:, 0].view("u8"), entries[:, 1].view("u8")
    return bool(
        chunk.start <= times.min() and times.max() <= chunk.end and offsets.max() < chunk.size
    )


def records_before_damage(source: ByteReader, chunk: Chunk) -> ByteReader:
    """Uncompress a chunk as far as it goes."""
    spool = Spool()
    with suppress(BadRecord):
        spool.fill(source, chunk)
    return spool
