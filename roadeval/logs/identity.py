"""The identity of a log's file: what tells whether its content has changed, without reading it."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from hashlib import blake2b
from typing import BinaryIO, Final

from mcap.opcode import Opcode

from roadeval.logs.container.records import MAGIC

_RECORD: Final = struct.Struct("<BQ")
"""Opcode and length of a record."""
_FOOTER: Final = struct.Struct("<BQQQI8s")
"""Opcode, length, start of the summary and of its offsets, checksum, magic."""
_CHUNK: Final = struct.Struct("<BQQQQI")
"""Opcode, length, first and last log time, size, checksum of the data before compression."""
_INDEX: Final = struct.Struct("<QQQQI")
"""First and last log time, place and length of a chunk, bytes of the map before the next field."""
_LENGTH: Final = struct.Struct("<Q")
_BLOCK: Final = 1 << 20
_LARGEST_SUMMARY: Final = 1 << 28


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
    size = file.seek(0, io.SEEK_END)
    digest, place = blake2b(str(size).encode(), digest_size=16), 0
    try:
        for start, length, end in sorted(_chunks(file, size)):
            file.seek(start)
            head = file.read(_CHUNK.size)
            opcode, own_length, _, _, data_size, crc = _CHUNK.unpack(head)
            wrong = opcode != Opcode.CHUNK or _RECORD.size + own_length != length or start < place
            if wrong or (data_size and not crc):
                return None
            _read(file, place, start, digest)
            digest.update(head)
            place = end
    except struct.error:
        return None
    if not place:
        return None
    _read(file, place, size, digest)
    return digest.hexdigest()


def _chunks(file: BinaryIO, size: int) -> Iterator[tuple[int, int, int]]:
    """Yield of each chunk its place, its length, and the end of its message indexes.

    None without a summary that is right.

    A struct.error where it ends too early.
    """
    file.seek(max(size - _FOOTER.size, 0))
    opcode, _, start, _, crc, magic = _FOOTER.unpack(footer := file.read())
    if opcode != Opcode.FOOTER or magic != MAGIC or not crc or not start:
        return
    file.seek(start)
    summary = file.read(min(max(size - _FOOTER.size - start, 0), _LARGEST_SUMMARY))
    if zlib.crc32(summary + footer[: -len(MAGIC) - 4]) != crc:
        return
    place = 0
    while place < len(summary):
        opcode, size = _RECORD.unpack_from(summary, place)
        body, place = place + _RECORD.size, place + _RECORD.size + size
        if opcode == Opcode.CHUNK_INDEX:
            _, _, start, length, map_size = _INDEX.unpack_from(summary, body)
            (indexes,) = _LENGTH.unpack_from(summary, body + _INDEX.size + map_size)
            yield start, length, start + length + indexes


def _read(file: BinaryIO, start: int, end: int, digest: blake2b) -> None:
    """Add a part of a file to a digest."""
    file.seek(start)
    while start < end and (block := file.read(min(_BLOCK, end - start))):
        digest.update(block)
        start += len(block)
