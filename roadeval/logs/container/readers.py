"""Bytes by position, from a file or from memory."""

from __future__ import annotations

from pathlib import Path
from typing import Final, Protocol

from roadeval.logs.errors import BadRecord

Buffer = bytes | memoryview

WINDOW: Final = 64 << 10
"""Bytes read at once while walking from record to record."""
GLANCE: Final = 1 << 10
"""Bytes read at once after a leap, as over the data of a chunk."""


class ByteReader(Protocol):
    """Bytes that need not lie in memory."""

    @property
    def size(self) -> int:
        """Number of bytes."""
        ...

    def read(self, offset: int, length: int) -> Buffer:
        """Read ``length`` bytes at ``offset``; fewer at the end."""
        ...

    def peek(self, offset: int, length: int) -> Buffer:
        """Like `read`, for a few bytes at a time on a walk forward."""
        ...


class MemoryReader:
    """Bytes in memory, returned without a copy."""

    def __init__(self, data: bytes) -> None:
        self._view = memoryview(data)
        self.size = len(data)

    def read(self, offset: int, length: int) -> Buffer:
        """Read ``length`` bytes at ``offset``; fewer at the end."""
        return self._view[offset : offset + length]

    peek = read


class FileReader:
    """A file.

    Nothing is mapped: pages of a mapped file count as memory of the program, and a file that
    shrinks while it is read would end the program with a bus error.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = path.open("rb", buffering=0)
        self.size = self._file.seek(0, 2)
        self._window = b""
        self._window_at = 0

    def read(self, offset: int, length: int) -> bytes:
        """Read ``length`` bytes at ``offset``; fewer at the end of the file.

        Raises
        ------
        BadRecord
            If the disk fails.
        """
        length = min(length, max(self.size - offset, 0))
        try:
            self._file.seek(offset)
            data = self._file.read(length)
            while len(data) < length and (more := self._file.read(length - len(data))):
                data += more
        except OSError as error:
            raise BadRecord(f"unreadable on its disk ({error.strerror})") from error
        return data

    def peek(self, offset: int, length: int) -> Buffer:
        """Like `read`, through a small window that suits a walk forward."""
        begin = offset - self._window_at
        if begin < 0 or begin + length > len(self._window):
            walks_on = 0 <= begin <= len(self._window) + GLANCE
            self._window = self.read(offset, max(length, WINDOW if walks_on else GLANCE))
            self._window_at, begin = offset, 0
        return memoryview(self._window)[begin : begin + length]

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class PartReader:
    """A part of a file, with positions of its own."""

    def __init__(self, source: FileReader, offset: int, size: int) -> None:
        self._source = source
        self._offset = offset
        self.size = size

    def read(self, offset: int, length: int) -> Buffer:
        """Read ``length`` bytes at ``offset``; fewer at the end."""
        return self._source.read(self._offset + offset, min(length, self.size - offset))

    def peek(self, offset: int, length: int) -> Buffer:
        """Like `read`, through the file's window."""
        return self._source.peek(self._offset + offset, min(length, self.size - offset))
