"""Uncompressing the data of chunks: at once, or block by block into bounded memory."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from typing import Final

from roadeval.logs.container.readers import Buffer, ByteReader
from roadeval.logs.container.records import Chunk
from roadeval.logs.errors import BadRecord

BLOCK: Final = 64 << 10
"""Bytes to take at a time of a chunk that is big, or damaged somewhere ahead."""
IN_MEMORY: Final = 16 << 20
"""Uncompressed bytes beyond which a chunk is held in a temporary file."""

_MAGIC: Final = {b"\x28\xb5\x2f\xfd": "zstd", b"\x04\x22\x4d\x18": "lz4"}


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


class Spool:
    """The records of a chunk that is uncompressed block by block: in a file if they are many."""

    def __init__(self) -> None:
        self._file = tempfile.SpooledTemporaryFile(max_size=IN_MEMORY)  # noqa: SIM115
        self.size = 0

    def fill(self, source: ByteReader, chunk: Chunk) -> None:
        """Uncompress a chunk; where that fails, what lies before the damage is kept.

        Raises
        ------
        BadRecord
            If it cannot be uncompressed to its end.
        """
        uncompress = _stepper(chunk.compression)
        for begin in range(0, chunk.data_size, BLOCK):
            block = source.read(chunk.data_offset + begin, min(BLOCK, chunk.data_size - begin))
            self.size += self._file.write(uncompress(bytes(block)))

    def read(self, offset: int, length: int) -> Buffer:
        """Read ``length`` bytes at ``offset``; fewer at the end."""
        self._file.seek(offset)
        return self._file.read(length)

    peek = read


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
