"""Chunks: from compressed bytes to records, checked, in bounded memory."""

from __future__ import annotations

import tempfile
import zlib
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from typing import IO, Final, cast

from roadeval.logs.container.records import Bytes, Chunk, FileBytes, walk
from roadeval.logs.errors import BadRecord

BLOCK: Final = 64 << 10
"""Bytes to take at a time of a chunk that is big, or damaged somewhere ahead."""
LARGEST_CHUNK: Final = 1 << 30
"""Most bytes that are uncompressed of a chunk: a few of them can become any number."""
IN_MEMORY: Final = 16 << 20
"""A chunk of more bytes is held in a temporary file; writers make chunks of about a megabyte."""
CACHE: Final = 16 << 20
"""Bytes of uncompressed chunks to keep: topics that run side by side share their chunks."""
KEEP: Final = 64
"""Chunks to keep at most."""
DOUBTED: Final = 256 << 20
"""Bytes that are tried in vain in a file of no size; a bigger one has four more for each byte."""
COMPRESSIONS: Final = ("", "zstd", "lz4")
_MAGIC: Final = {b"\x28\xb5\x2f\xfd": "zstd", b"\x04\x22\x4d\x18": "lz4"}


class ChunkReader:
    """Reads the chunks of a file, the last few from memory.

    Parameters
    ----------
    keep_corrupt
        Whether to read what is left of a chunk whose checksum is wrong.
    """

    def __init__(self, source: FileBytes, *, keep_corrupt: bool = False) -> None:
        self._source = source
        self._keep_corrupt = keep_corrupt
        self._cache: OrderedDict[int, Bytes] = OrderedDict()
        self._doubts_left = DOUBTED + 4 * len(source)
        self.bad: dict[int, str] = {}
        """Why a chunk could not be read, by its offset."""
        self.kept: dict[int, str] = {}
        """What is wrong with a chunk that was read nevertheless, by its offset."""

    def read(self, chunk: Chunk) -> Bytes:
        """Read the records of a chunk; of one that is cut off, those before the cut."""
        if chunk.offset in self.bad:
            raise BadRecord(self.bad[chunk.offset])
        if chunk.offset in self._cache:
            self._cache.move_to_end(chunk.offset)
            return self._cache[chunk.offset]
        try:
            records = self.remains(chunk) if chunk.cut else self._whole(chunk)
        except BadRecord as error:
            if not self._keep_corrupt:
                self.bad[chunk.offset] = str(error)
                raise
            self.kept[chunk.offset] = f"{error}, used all the same"
            records = self.remains(chunk)
        return self._keep(chunk, records)

    def remains(self, chunk: Chunk) -> FileBytes:
        """Uncompress a chunk as far as it goes."""

        def good() -> Iterator[bytes]:
            with suppress(BadRecord):
                yield from _blocks(self._source, chunk)

        return _spooled(good())

    def is_sound(self, chunk: Chunk) -> bool:
        """Whether the content of a chunk is what its head says.

        Without a checksum it must consist of whole records. Of a file that claims one wrong chunk
        after the other only so many are looked at.
        """
        if self._doubts_left < 0 or chunk.data_end > len(self._source):
            return False
        before = self._doubts_left
        with suppress(BadRecord):
            records = self._whole(chunk)
            if chunk.crc or max((each.end for each in walk(records)), default=0) == chunk.size:
                self._keep(chunk, records)
                self._doubts_left = before
                return True
        self._doubts_left -= chunk.data_size
        return False

    def _whole(self, chunk: Chunk) -> Bytes:
        records = self._uncompressed(chunk)
        if len(records) != chunk.size:
            raise BadRecord(f"a chunk of {len(records)} bytes that claims to hold {chunk.size}")
        if chunk.crc is None:
            raise BadRecord("a chunk whose head is damaged")
        if chunk.crc and crc_of(records) != chunk.crc:
            raise BadRecord("a chunk whose checksum is wrong")
        return records

    def _uncompressed(self, chunk: Chunk) -> Bytes:
        if max(chunk.size, chunk.data_size) <= IN_MEMORY:
            data = bytes(self._source[chunk.data_offset : chunk.data_end])
            self._doubts_left -= chunk.size
            return memoryview(_uncompressed(data, chunk.compression, chunk.size))
        if chunk.compression == "":
            return self._source.part(chunk.data_offset, chunk.data_end)
        return _spooled(self._counted(_blocks(self._source, chunk)))

    def _counted(self, blocks: Iterator[bytes]) -> Iterator[bytes]:
        for block in blocks:
            self._doubts_left -= len(block)
            yield block

    def _keep(self, chunk: Chunk, records: Bytes) -> Bytes:
        self._cache[chunk.offset] = records
        held = sum(len(each) for each in self._cache.values() if isinstance(each, memoryview))
        while (held > CACHE and len(self._cache) > 2) or len(self._cache) > KEEP:
            first = self._cache.popitem(last=False)[1]
            held -= len(first) if isinstance(first, memoryview) else 0
        return records


def crc_of(records: Bytes) -> int:
    """CRC-32 of bytes."""
    crc, step = 0, BLOCK if isinstance(records, FileBytes) else max(len(records), 1)
    for offset in range(0, len(records), step):
        crc = zlib.crc32(records[offset : offset + step], crc)
    return crc


def _uncompressed(data: bytes, compression: str, size: int) -> bytes:
    """Uncompress a chunk's data at once; a damaged name does no harm, for the data has its own."""
    import lz4.frame
    import zstandard

    name = compression if compression in COMPRESSIONS else _MAGIC.get(data[:4], compression)
    try:
        if name == "zstd":
            # The library would make room for whatever the frame's own head claims.
            if zstandard.frame_content_size(data) not in (-1, size):
                raise BadRecord("a chunk whose sizes contradict each other")
            return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
        if name == "lz4":
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, size + 1))
    except (zstandard.ZstdError, RuntimeError) as error:
        raise BadRecord(f"a chunk that {name} cannot uncompress") from error
    if name:
        raise BadRecord(f"a chunk compressed by {compression!r}, which is unknown")
    return data


def _spooled(blocks: Iterator[bytes]) -> FileBytes:
    """Hold the records of a chunk: in a temporary file if they are many."""
    file = tempfile.SpooledTemporaryFile(max_size=IN_MEMORY)  # noqa: SIM115
    for block in blocks:  # `writelines` would hold them all in memory
        file.write(block)
    return FileBytes(cast("IO[bytes]", file))


def _blocks(source: FileBytes, chunk: Chunk) -> Iterator[bytes]:
    """Uncompress a chunk into blocks of a bounded size, whatever they were compressed from."""
    import zstandard

    data, left = source.part(chunk.data_offset, chunk.data_end), LARGEST_CHUNK
    blocks: Iterator[bytes]
    try:
        if chunk.compression == "zstd":
            stream = cast("IO[bytes]", data)
            blocks = zstandard.ZstdDecompressor().read_to_iter(stream, BLOCK, BLOCK)
        elif chunk.compression == "lz4":
            blocks = _lz4_blocks(data)
        elif chunk.compression == "":
            blocks = iter(partial(data.read, BLOCK), b"")
        else:
            raise BadRecord(f"a chunk compressed by {chunk.compression!r}, which is unknown")
        for block in blocks:
            left -= len(block)
            if left < 0:
                raise BadRecord(f"a chunk of more than {LARGEST_CHUNK >> 20} MiB")
            yield block
    except (zstandard.ZstdError, RuntimeError) as error:
        raise BadRecord(f"a chunk that {chunk.compression} cannot uncompress") from error


def _lz4_blocks(data: FileBytes) -> Iterator[bytes]:
    import lz4.frame

    frame = lz4.frame.LZ4FrameDecompressor()
    while not frame.eof:
        block = data.read(BLOCK) if frame.needs_input else b""
        if frame.needs_input and not block:
            return
        yield frame.decompress(block, BLOCK)
