"""Uncompressing the data of chunks: at once, or block by block into bounded memory."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from functools import partial
from typing import IO, Final, cast

from roadeval.logs.container.readers import Buffer, ByteReader
from roadeval.logs.container.records import Chunk
from roadeval.logs.errors import BadRecord

BLOCK: Final = 64 << 10
"""Bytes to take at a time of a chunk that is big, or damaged somewhere ahead."""
LARGEST_CHUNK: Final = 1 << 30
"""Most bytes that are uncompressed of a chunk: a few of them can become any number."""
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
            If it cannot be uncompressed to its end, or is too large.
        """
        for block in _blocks(chunk.compression, _Stream(source, chunk)):
            self.size += self._file.write(block)
            if self.size > LARGEST_CHUNK:
                raise BadRecord(f"a chunk of more than {LARGEST_CHUNK >> 20} MiB")

    def read(self, offset: int, length: int) -> Buffer:
        """Read ``length`` bytes at ``offset``; fewer at the end."""
        self._file.seek(offset)
        return self._file.read(length)

    peek = read


class _Stream:
    """A chunk's data as a file that is read from its begin to its end."""

    def __init__(self, source: ByteReader, chunk: Chunk) -> None:
        self._source = source
        self._at = chunk.data_offset
        self._end = chunk.data_offset + chunk.data_size

    def read(self, size: int) -> bytes:
        """Return the next bytes, none at the end."""
        data = bytes(self._source.read(self._at, min(size, self._end - self._at)))
        self._at += len(data)
        return data


def _blocks(compression: str, data: _Stream) -> Iterator[bytes]:
    """Uncompress a stream into blocks of a bounded size, whatever they were compressed from."""
    import zstandard

    try:
        if compression == "zstd":
            yield from zstandard.ZstdDecompressor().read_to_iter(
                cast("IO[bytes]", data), BLOCK, BLOCK
            )
        elif compression == "lz4":
            yield from _lz4_blocks(data)
        elif compression == "":
            yield from iter(partial(data.read, BLOCK), b"")
        else:
            raise BadRecord(f"a chunk compressed by {compression!r}, which is unknown")
    except (zstandard.ZstdError, RuntimeError) as error:
        raise BadRecord(f"a chunk that {compression} cannot uncompress") from error


def _lz4_blocks(data: _Stream) -> Iterator[bytes]:
    import lz4.frame

    frame = lz4.frame.LZ4FrameDecompressor()
    while not frame.eof:
        block = data.read(BLOCK) if frame.needs_input else b""
        if frame.needs_input and not block:
            return
        yield frame.decompress(block, BLOCK)
