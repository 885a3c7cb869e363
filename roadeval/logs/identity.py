"""The identity of a log's file: what tells whether its content has changed, without reading it."""

from __future__ import annotations

from collections.abc import Iterator
from hashlib import blake2b
from typing import BinaryIO, Final

from mcap.opcode import Opcode

from roadeval.logs.container.records import FileBytes, parse_chunk, record_at
from roadeval.logs.container.summary import read_summary
from roadeval.logs.errors import BadRecord

BLOCK: Final = 1 << 20


def identity_of(file: BinaryIO) -> str | None:
    """Return a digest of an MCAP file that takes what its chunks hold from their checksums.

    Read are the summary, the heads of the chunks, and whatever lies outside of the chunks and their
    message indexes. The same content has the same digest. A byte changed in a chunk under an old
    checksum does not show; reading that chunk tells.

    Returns
    -------
    str or None
        In hexadecimal. None where only the whole content tells: chunks have no checksums, or there
        are none, or no summary whose own checksum is right.
    """
    source = FileBytes(file)
    digest, place = blake2b(str(len(source)).encode(), digest_size=16), 0
    try:
        summary = read_summary(source)
        if not summary.in_place or not summary.chunks:
            return None
        for offset in sorted(summary.chunks):
            record = record_at(source, offset)
            chunk = parse_chunk(source, record)
            is_listed = record.opcode == Opcode.CHUNK and record.end == chunk.data_end
            is_listed &= chunk.listing == summary.chunks[offset].listing and offset >= place
            if not is_listed or (chunk.size and not chunk.crc):
                return None
            for block in _blocks(source, place, offset):
                digest.update(block)
            digest.update(repr(chunk).encode())
            place = summary.index_ends[offset]
        for block in _blocks(source, place, len(source)):
            digest.update(block)
    except BadRecord:
        return None
    return digest.hexdigest()


def _blocks(source: FileBytes, start: int, end: int) -> Iterator[bytes | memoryview]:
    for at in range(start, end, BLOCK):
        yield source[at : min(at + BLOCK, end)]
