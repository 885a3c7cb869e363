"""Chunks: from compressed bytes to records, checked, in bounded memory."""

from __future__ import annotations

import tempfile
import zlib
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Final

from roadeval.logs.container.records import Chunk
from roadeval.logs.container.source import Buffer, Bytes, Memory, Part, Source
from roadeval.logs.errors import BadRecord

BIG: Final = 16 << 20
"""A chunk of more bytes is not held in memory; writers make chunks of about a megabyte."""
CACHE: Final = 16 << 20
"""Bytes of uncompressed chunks to keep: topics that run side by side share their chunks."""
KEEP: Final = 64
"""Chunks to keep at most."""
BLOCK: Final = 64 << 10
"""Bytes to take at a time of a chunk that is big, or damaged somewhere ahead."""

_MAGIC: Final = {b"\x28\xb5\x2f\xfd": "zstd", b"\x04\x22\x4d\x18": "lz4"}


class ChunkReader:
    """Reads the chunks of a file, the last few from memory.

    Parameters
    ----------
    keep_corrupt
        Whether to hand out what is left of a chunk that cannot be trusted.

    Attributes
    ----------
    bad
        Why a chunk could not be read, by its offset.
    kept
        Why a chunk should not have been, if it was all the same.
    """

    def __init__(self, source: Source, *, keep_corrupt: bool = False) -> None:
        self._source = source
        self._keep_corrupt = keep_corrupt
        self._cache: OrderedDict[int, Bytes] = OrderedDict()
        self._held = 0
        self.bad: dict[int, str] = {}
        self.kept: dict[int, str] = {}

    def read(self, chunk: Chunk) -> Bytes:
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

    def _load(self, chunk: Chunk) -> Bytes:
        if chunk.cut:
            return self._rest(chunk)
        try:
            records = self._whole(chunk)
            _check(records, chunk)
        except BadRecord as error:
            if self._keep_corrupt:
                self.kept[chunk.offset] = f"{error}, used all the same"
                return self._rest(chunk)
            self.bad[chunk.offset] = str(error)
            raise
        return records

    def _whole(self, chunk: Chunk) -> Bytes:
        if max(chunk.size, chunk.data_size) <= BIG:
            data = self._source.read(chunk.data_offset, chunk.data_size)
            return Memory(decompress(data, chunk.compression, chunk.size))
        if chunk.compression == "":
            return Part(self._source, chunk.data_offset, chunk.data_size)
        spool = _Spool()
        for records in self._stream(chunk):
            spool.write(records)
        return spool

    def _rest(self, chunk: Chunk) -> Bytes:
        """Uncompress as far as it goes."""
        spool = _Spool()
        with suppress(BadRecord):
            for records in self._stream(chunk):
                spool.write(records)
        return spool

    def _stream(self, chunk: Chunk) -> Iterator[bytes]:
        step = _stepper(chunk.compression)
        for begin in range(0, chunk.data_size, BLOCK):
            length = min(BLOCK, chunk.data_size - begin)
            yield step(self._source.read(chunk.data_offset + begin, length))

    def _keep(self, offset: int, records: Bytes) -> None:
        self._cache[offset] = records
        self._held += _held(records)
        while (self._held > CACHE and len(self._cache) > 2) or len(self._cache) > KEEP:
            self._held -= _held(self._cache.popitem(last=False)[1])


class _Spool:
    """Bytes in memory if they are few, else in a file without a name."""

    def __init__(self) -> None:
        self._file = tempfile.SpooledTemporaryFile(max_size=BIG)  # noqa: SIM115
        self.size = 0

    def write(self, data: bytes) -> None:
        self.size += self._file.write(data)

    def read(self, offset: int, length: int) -> Buffer:
        self._file.seek(offset)
        return self._file.read(length)

    peek = read


def _held(records: Bytes) -> int:
    return records.size if isinstance(records, Memory) else 0


def _check(records: Bytes, chunk: Chunk) -> None:
    if records.size != chunk.size:
        raise BadRecord(f"a chunk of {records.size} bytes that claims to hold {chunk.size}")
    if chunk.crc is None:
        raise BadRecord("a chunk whose head is damaged")
    if chunk.crc and crc_of(records) != chunk.crc:
        raise BadRecord("a chunk whose checksum is wrong")


def crc_of(records: Bytes, size: int | None = None) -> int:
    """CRC-32 of the first ``size`` bytes, or of all."""
    size = records.size if size is None else size
    if isinstance(records, Memory):
        return zlib.crc32(records.read(0, size))
    crc = 0
    for offset in range(0, size, BLOCK):
        crc = zlib.crc32(records.read(offset, min(BLOCK, size - offset)), crc)
    return crc


def decompress(data: bytes, compression: str, size: int) -> bytes:
    """Uncompress a chunk's data at once.

    A name that is damaged does no harm: the data begins with its own.

    Raises
    ------
    BadRecord
        If it cannot be uncompressed to ``size`` bytes.
    """
    known = compression in ("", "zstd", "lz4")
    name = compression if known else _MAGIC.get(data[:4], compression)
    if name == "zstd":
        return _zstd(data, size)
    if name == "lz4":
        return _lz4(data, size)
    if name:
        raise BadRecord(f"a chunk compressed by {compression!r}, which is unknown")
    return data


def _zstd(data: bytes, size: int) -> bytes:
    import zstandard

    try:
        # The library would make room for whatever the frame's own head claims.
        if zstandard.frame_content_size(data) not in (-1, size):
            raise BadRecord("a chunk whose sizes contradict each other")
        records: bytes = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    except zstandard.ZstdError as error:
        raise BadRecord("a chunk that zstd cannot uncompress") from error
    return records


def _lz4(data: bytes, size: int) -> bytes:
    import lz4.frame

    try:
        records: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, size + 1)
    except RuntimeError as error:
        raise BadRecord("a chunk that lz4 cannot uncompress") from error
    return records


def _stepper(compression: str) -> Callable[[bytes], bytes]:
    """Return what uncompresses a stream block by block, each block as far as it goes."""
    if compression == "":
        return lambda block: block
    if compression not in ("zstd", "lz4"):
        raise BadRecord(f"a chunk compressed by {compression!r}, which is unknown")
    import lz4.frame
    import zstandard

    if compression == "zstd":
        inner = zstandard.ZstdDecompressor().decompressobj().decompress
    else:
        inner = lz4.frame.LZ4FrameDecompressor().decompress

    def step(block: bytes) -> bytes:
        try:
            records: bytes = inner(block)
        except (zstandard.ZstdError, RuntimeError, EOFError) as error:
            raise BadRecord(f"a chunk that {compression} cannot uncompress") from error
        return records

    return step
