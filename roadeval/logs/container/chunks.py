"""Chunks: from compressed bytes to records, checked, in bounded memory."""

from __future__ import annotations

import zlib
from collections import OrderedDict
from typing import Final

from roadeval.logs.container.compression import BLOCK, IN_MEMORY, Spool, decompress
from roadeval.logs.container.readers import ByteReader, FileReader, MemoryReader, PartReader
from roadeval.logs.container.records import Chunk
from roadeval.logs.container.recovery.damaged_chunks import records_before_damage
from roadeval.logs.errors import BadRecord

BIG: Final = IN_MEMORY
"""A chunk of more bytes is not held in memory; writers make chunks of about a megabyte."""
CACHE: Final = 16 << 20
"""Bytes of uncompressed chunks to keep: topics that run side by side share their chunks."""
KEEP: Final = 64
"""Chunks to keep at most."""


class ChunkReader:
    """Reads the chunks of a file, the last few from memory.

    Parameters
    ----------
    keep_corrupt
        Whether to read what is left of a chunk whose checksum is wrong.

    Attributes
    ----------
    bad
        Why a chunk could not be read, by its offset.
    kept
        What is wrong with a chunk that was read nevertheless, by its offset.
    whole
        Offsets of the chunks that were found to be whole.
    """

    def __init__(self, source: FileReader, *, keep_corrupt: bool = False) -> None:
        self._source = source
        self._keep_corrupt = keep_corrupt
        self._cache: OrderedDict[int, ByteReader] = OrderedDict()
        self._held = 0
        self.bad: dict[int, str] = {}
        self.kept: dict[int, str] = {}
        self.whole: set[int] = set()

    def read(self, chunk: Chunk) -> ByteReader:
        """Read the records of a chunk; of one that is cut off, those before the cut.

        Raises
        ------
        BadRecord
            If the chunk cannot be uncompressed or its checksum is wrong.
        """
        if chunk.offset in self.bad:
            raise BadRecord(self.bad[chunk.offset])
        records = self._cache.get(chunk.offset)
        if records is None:
            records = self._load(chunk)
            self._keep(chunk.offset, records)
        else:
            self._cache.move_to_end(chunk.offset)
        return records

    def _load(self, chunk: Chunk) -> ByteReader:
        if chunk.cut:
            return records_before_damage(self._source, chunk)
        try:
            records = self._whole(chunk)
            _check(records, chunk)
        except BadRecord as error:
            if self._keep_corrupt:
                self.kept[chunk.offset] = f"{error}, used all the same"
                return records_before_damage(self._source, chunk)
            self.bad[chunk.offset] = str(error)
            raise
        self.whole.add(chunk.offset)
        return records

    def _whole(self, chunk: Chunk) -> ByteReader:
        if max(chunk.size, chunk.data_size) <= BIG:
            data = self._source.read(chunk.data_offset, chunk.data_size)
            return MemoryReader(decompress(data, chunk.compression, chunk.size))
        if chunk.compression == "":
            return PartReader(self._source, chunk.data_offset, chunk.data_size)
        spool = Spool()
        spool.fill(self._source, chunk)
        return spool

    def _keep(self, offset: int, records: ByteReader) -> None:
        self._cache[offset] = records
        self._held += _held(records)
        while (self._held > CACHE and len(self._cache) > 2) or len(self._cache) > KEEP:
            self._held -= _held(self._cache.popitem(last=False)[1])


def _held(records: ByteReader) -> int:
    return records.size if isinstance(records, MemoryReader) else 0


def _check(records: ByteReader, chunk: Chunk) -> None:
    if records.size != chunk.size:
        raise BadRecord(f"a chunk of {records.size} bytes that claims to hold {chunk.size}")
    if chunk.crc is None:
        raise BadRecord("a chunk whose head is damaged")
    if chunk.crc and crc_of(records) != chunk.crc:
        raise BadRecord("a chunk whose checksum is wrong")


def crc_of(records: ByteReader, size: int | None = None) -> int:
    """CRC-32 of the first ``size`` bytes, or of all."""
    size = records.size if size is None else size
    if isinstance(records, MemoryReader):
        return zlib.crc32(records.read(0, size))
    crc = 0
    for offset in range(0, size, BLOCK):
        crc = zlib.crc32(records.read(offset, min(BLOCK, size - offset)), crc)
    return crc
