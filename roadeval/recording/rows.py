"""Rows of an entity, gathered over frames and sent as one chunk.

A chunk costs about 1.1 kB in the file, 0.1 ms, and 1.5 to 3 kB of memory until the end, because
Rerun's index has a cell for every component of the recording in every chunk's row. A chunk a frame
and entity would cost more than most of what it holds.

Rerun can batch by itself (`rerun.ChunkBatcherConfig`), but takes 2.7 ms a frame more on the demo,
and bounds neither what a killed run loses nor the memory of what waits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from roadeval.recording.layout import FRAME, HEADER_TIME, LOG_TIME, MOST_WAITING, STAMP

When = tuple[int, int, int]
"""A frame's number, header stamp and log time, the times in nanoseconds."""
Columns = Callable[[list[Any]], Any]
"""Makes the viewer's component columns of one value a row."""
Key = tuple[str, Columns]
"""An entity's path, and the kind of its rows."""

NOTHING: Final = None
"""A row without a value: from there on the viewer shows nothing of the entity.

`rerun.Clear` has no effect on encoded images: https://github.com/rerun-io/rerun/issues/12793.
"""

CHUNK_BYTES: Final = 1 << 19
"""Bytes of images and text at which a chunk is full: it is read whole, for one picture, too, and is
held in memory several times while it is packed and written."""

SHARE: Final = 8
"""One frame in this many may wait, within `WaitLimits`."""


@dataclass(frozen=True)
class WaitLimits:
    """For how many frames rows wait: a share of the frames so far, from ``least`` to ``most``.

    A killed run loses the rows that wait.
    """

    least: int
    most: int

    def after(self, frames: int) -> int:
        """Return for how many frames rows wait when the recording has ``frames``."""
        return min(max(frames // SHARE, self.least), self.most)


IMAGES_AND_TEXT: Final = WaitLimits(8, MOST_WAITING)
"""Of images, notes, states and table lines."""
NUMBERS: Final = WaitLimits(64, 1024)
"""Of the graphs' numbers: many entities, a few bytes a frame each."""


class PendingRows:
    """The rows of one entity that wait."""

    def __init__(self, path: str, columns: Columns, header_time: str = HEADER_TIME) -> None:
        self._path, self._columns, self._header_time = path, columns, header_time
        self._rows: list[tuple[When, Any]] = []
        self.size = 0

    def add(self, when: When, value: Any) -> None:
        """Append a row of a frame, perhaps with `NOTHING`."""
        self._rows.append((when, value))
        self.size += _size(value)

    def chunk(self) -> Chunk:
        """Return all rows as one chunk."""
        whens, values = zip(*self._rows, strict=True)
        frames, stamps, logged = np.array(whens).T
        named = zip((STAMP, self._header_time, LOG_TIME), (stamps, stamps, logged), strict=True)
        times = [
            rr.TimeColumn(FRAME, sequence=frames),
            *(rr.TimeColumn(n, timestamp=own.astype("datetime64[ns]")) for n, own in named),
        ]
        columns = self._columns([value for value in values if value is not NOTHING])
        if NOTHING in values:
            columns = columns.partition([int(value is not NOTHING) for value in values])
        return Chunk.from_columns(self._path, times, columns)


class Batcher(dict[Key, PendingRows]):
    """The rows of entities with the same `WaitLimits`: due together, or one entity's when full."""

    def __init__(self, limits: WaitLimits, header_time: str = HEADER_TIME) -> None:
        super().__init__()
        self._limits, self._header_time = limits, header_time
        self._frames = self._due = 0

    def __missing__(self, key: Key) -> PendingRows:
        self[key] = PendingRows(*key, self._header_time)
        return self[key]

    @property
    def size(self) -> int:
        """Bytes of images and text that wait."""
        return sum(rows.size for rows in self.values())

    def end_frame(self) -> list[Key]:
        """Count a frame; return the keys of rows that are due."""
        self._frames += 1
        if self._frames - self._due >= self._limits.after(self._frames):
            self._due = self._frames
            return list(self)
        return [key for key, rows in self.items() if rows.size >= CHUNK_BYTES]


def _size(value: Any) -> int:
    """Return the bytes of an image, the letters of a text or of a note's two; 0 of a number."""
    if isinstance(value, tuple):
        return sum(map(_size, value))
    return len(value) if isinstance(value, bytes | str) else 0


def numbers(values: list[tuple[float, ...]]) -> Any:
    """Return columns of one number a row, or of several, as those of `layout.COUNTS`."""
    flat = np.array(values, np.float64)
    return rr.Scalars.columns(scalars=flat.ravel()).partition([flat.shape[1]] * len(flat))


def states(values: list[str]) -> Any:
    """Return columns that begin a state a row, or end one with an empty text."""
    return rr.StateChange.columns(state=values)


def texts(values: list[str]) -> Any:
    """Return columns of one document a row."""
    return rr.TextDocument.columns(text=values)


def notes(values: list[tuple[str, str]]) -> Any:
    """Return columns of one sentence and its level a row."""
    sentences, levels = zip(*values, strict=True)
    return rr.TextLog.columns(text=list(sentences), level=list(levels))
