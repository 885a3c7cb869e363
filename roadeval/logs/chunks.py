"""Chunks: from compressed bytes to records, checked."""

from __future__ import annotations

import zlib
from collections import OrderedDict
from typing import Final

from roadeval.logs.records import BadRecord, Chunk
from roadeval.logs.source import Source

LARGEST: Final = 1 << 30
"""Bytes a chunk may hold; writers make chunks of about a megabyte."""
CACHE: Final = 32 << 20
"""Bytes of uncompressed chunks to keep: topics that run side by side share their chunks."""


def decompress(data: bytes, compression: str, size: int) -> bytes:
    """Uncompress a chunk's data to exactly ``size`` bytes.

    Raises
    ------
    BadRecord
        If it cannot be, or the result has another size.
    """
    if size > LARGEST:
        raise BadRecord(f"a chunk that claims to hold {size} bytes")
    if compression == "":
        records = data
    elif compression == "zstd":
        records = _zstd(data, size)
    elif compression == "lz4":
        records = _lz4(data)
    else:
        raise BadRecord(f"a chunk compressed by {compression!r}, which is unknown")
    if len(records) != size:
        raise BadRecord(f"a chunk of {len(records)} bytes that claims to hold {size}")
    return records


def _zstd(data: bytes, size: int) -> bytes:
    import zstandard

    try:
        records: bytes = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    except zstandard.ZstdError as error:
        raise BadRecord("a chunk that zstd cannot uncompress") from error
    return records


def _lz4(data: bytes) -> bytes:
    import lz4.frame

    try:
        records: bytes = lz4.frame.decompress(data)
    except RuntimeError as error:
        raise BadRecord("a chunk that lz4 cannot uncompress") from error
    return records


class ChunkReader:
    """Reads the chunks of a file, the last few from memory.

    Parameters
    ----------
    keep_corrupt
        Whether to hand out a chunk whose checksum is wrong.
    """

    def __init__(self, source: Source, *, keep_corrupt: bool = False) -> None:
        self._source = source
        self._keep_corrupt = keep_corrupt
        self._cache: OrderedDict[int, bytes] = OrderedDict()
        self._cached = 0

    def read(self, chunk: Chunk) -> bytes:
        """Read the records of a chunk.

        Raises
        ------
        BadRecord
            If the chunk cannot be uncompressed or its checksum is wrong.
        """
        records = self._cache.get(chunk.offset)
        if records is None:
            records = self._load(chunk)
            self._keep(chunk.offset, records)
        else:
            self._cache.move_to_end(chunk.offset)
        return records

    def _load(self, chunk: Chunk) -> bytes:
        data = self._source.read(chunk.data_offset, chunk.data_size)
        records = decompress(data, chunk.compression, chunk.size)
        if chunk.crc and not self._keep_corrupt and zlib.crc32(records) != chunk.crc:
            raise BadRecord("a chunk whose checksum is wrong")
        return records

    def _keep(self, offset: int, records: bytes) -> None:
        self._cache[offset] = records
        self._cached += len(records)
        while self._cached > CACHE and len(self._cache) > 2:
            self._cached -= len(self._cache.popitem(last=False)[1])
