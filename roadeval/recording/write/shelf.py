"""Pictures of frames put aside on the disk, until it is known which of them are kept."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from roadeval.recording.layout import RecordingError
from roadeval.recording.write.encoding import Encoded

PAGE: Final = 1 << 16
"""Bytes of a page of the file; the room of a frame that is dropped is taken by the next."""

_OPEN: Final = f"""
    PRAGMA page_size = {PAGE};
    PRAGMA journal_mode = OFF;
    PRAGMA synchronous = OFF;
    CREATE TABLE pictures (frame INTEGER, stamp_ns INTEGER, path TEXT, payload BLOB);
    CREATE INDEX frames ON pictures (frame);
"""
"""Nobody reads the file after a crash, so nothing is done to keep it whole."""


class Shelf:
    """Holds frames' pictures by number in a file that is there only while it holds some.

    Parameters
    ----------
    path
        The file. One that is there, of a run that was killed, is replaced.

    Raises
    ------
    RecordingError
        From every method, if the file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path: Final = path
        self._file: sqlite3.Connection | None = None

    def put(self, encoded: Encoded) -> None:
        """Put a frame's pictures here; its numbers and words are left out."""
        rows = (
            (encoded.number, encoded.stamp_ns, path, payload)
            for path, payload in encoded.payloads.items()
        )
        with self._opened() as file:
            file.executemany("INSERT INTO pictures VALUES (?, ?, ?, ?)", rows)

    def drop(self, number: int) -> None:
        """Forget a frame."""
        with self._opened() as file:
            file.execute("DELETE FROM pictures WHERE frame = ?", (number,))

    def get(self, number: int) -> Encoded:
        """Give a frame that was put here and not dropped, with its pictures alone."""
        query = "SELECT stamp_ns, path, payload FROM pictures WHERE frame = ? ORDER BY rowid"
        with self._opened() as file:
            rows = file.execute(query, (number,)).fetchall()
        if not rows:
            raise RecordingError(
                f"{self._path}: the pictures of frame {number} are lost; was the disk full?"
            )
        payloads = {path: payload for _, path, payload in rows}
        return Encoded(number, rows[0][0], payloads, {}, {}, {}, (), {})

    def close(self) -> None:
        """Forget all, and remove the file."""
        if self._file is not None:
            file, self._file = self._file, None
            with self._explained():
                try:
                    file.close()
                finally:
                    self._path.unlink(missing_ok=True)

    def sweep(self) -> None:
        """Remove the file that a run that was killed has left, if there is one."""
        with self._explained():
            self._path.unlink(missing_ok=True)

    @contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        with self._explained():
            if self._file is None:
                self.sweep()
                # Nobody else opens it, and not every disk of a network can lock a file.
                place = f"{self._path.absolute().as_uri()}?nolock=1"
                self._file = sqlite3.connect(place, uri=True, isolation_level=None)
                self._file.executescript(_OPEN)
            yield self._file

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except (OSError, sqlite3.Error) as error:
            raise RecordingError(
                f"{self._path}: cannot be written ({error}); is the disk full?"
            ) from error
