"""The bytes of a file, by position."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Final

WINDOW: Final = 16 * 1024
"""Bytes read at once while walking from record to record."""


class Source:
    """A file read by position.

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
        """Read ``length`` bytes at ``offset``; fewer at the end of the file."""
        self._file.seek(offset)
        data = self._file.read(min(length, max(self.size - offset, 0)))
        while len(data) < length and (more := self._file.read(length - len(data))):
            data += more
        return data

    def peek(self, offset: int, length: int) -> memoryview:
        """Like `read`, through a small window that suits a walk forward."""
        begin = offset - self._window_at
        if begin < 0 or begin + length > len(self._window):
            self._window = self.read(offset, max(length, WINDOW))
            self._window_at, begin = offset, 0
        return memoryview(self._window)[begin : begin + length]

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Source:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
