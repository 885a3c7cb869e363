"""The identity of a log's file: what tells whether its content has changed, without reading it."""

from __future__ import annotations

from hashlib import blake2b
from typing import BinaryIO, Final

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
        if not summary.checked or not summary.chunks:
            return None
        for offset in sorted(summary.chunks):
            chunk = parse_chunk(source, record_at(source, offset))
            is_listed = chunk.listing == summary.chunks[offset].listing and offset >= place
            if not is_listed or (chunk.size and not chunk.crc):
                return None
            for at in range(place, chunk.data_offset, BLOCK):
                digest.update(source[at : min(at + BLOCK, chunk.data_offset)])
            place = summary.index_ends[offset]
        for at in range(place, len(source), BLOCK):
            digest.update(source[at : at + BLOCK])
    except BadRecord:
        return None
    return digest.hexdigest()
