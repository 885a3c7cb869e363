"""Rows of one entity, gathered over frames and sent as one chunk.

A chunk costs about 1.1 kB in the file, 0.1 ms, and 1.5 to 3 kB of memory until the end: Rerun's
index of the file has a place for every component of the recording in every chunk's row. A chunk a
frame and entity would cost more than most of what it holds, and more with every minute.

Rerun can batch by itself (`rerun.ChunkBatcherConfig`). On the demo that makes 31 chunks where this
makes 661, but it takes 2.7 ms a frame more, for each row then crosses into Rerun alone, and it
neither bounds what a killed run loses nor the memory of what waits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from roadeval.recording.layout import FRAME, MOST_WAITING, STAMP

Columns = Callable[[list[Any]], Any]
"""Makes the viewer's component columns of one value a row."""
Key = tuple[str, Columns]
"""An entity's path, and the kind of its rows."""

NOTHING: Final = None
"""Stands for a row without a value: from there on the viewer shows nothing of the entity.

Rerun has `rerun.Clear` for that, which its viewer overlooks on encoded images:
https://github.com/rerun-io/rerun/issues/12793.
"""

CHUNK_BYTES: Final = 2 << 20
"""Of images and text at which a chunk is full, however few its frames: the viewer reads chunks
whole, and memory holds one several times while it is packed and written."""

SHARE: Final = 8
"""One frame in so many may wait, within `WaitLimits`: of a short recording few do."""


@dataclass(frozen=True, slots=True)
class WaitLimits:
    """For how many frames rows wait: a share of those so far, but from ``least`` to ``most``.

    A killed run loses what waits.
    """

    least: int
    most: int

    def after(self, frames: int) -> int:
        """Return for how many frames rows wait when the recording has this many."""
        return min(max(frames // SHARE, self.least), self.most)


IMAGES_AND_TEXT: Final = WaitLimits(8, MOST_WAITING)
"""Of what is read frame by frame: images, notes, states, table lines."""
NUMBERS: Final = WaitLimits(64, 1024)
"""Of the graphs' numbers: many entities of a few bytes a frame."""


class PendingRows:
    """The rows of one entity that wait."""

    def __init__(self, path: str, columns: Columns) -> None:
        self._path = path
        self._columns = columns
        self._frames: list[int] = []
        self._stamps: list[int] = []
        self._values: list[Any] = []
        self.size = 0

    def add(self, frame: int, stamp_ns: int, value: Any) -> None:
        """Append a row, perhaps with `NOTHING`, at this frame number and header stamp."""
        self._frames.append(frame)
        self._stamps.append(stamp_ns)
        self._values.append(value)
        self.size += _size(value)

    def chunk(self) -> Chunk:
        """Return all rows as one chunk."""
        times = [
            rr.TimeColumn(FRAME, sequence=self._frames),
            rr.TimeColumn(STAMP, timestamp=np.array(self._stamps, "datetime64[ns]")),
        ]
        values = [value for value in self._values if value is not NOTHING]
        columns = self._columns(values)
        if len(values) < len(self._values):
            columns = columns.partition([int(value is not NOTHING) for value in self._values])
        return Chunk.from_columns(self._path, times, columns)


class Batcher:
    """The pending rows of entities that wait alike: all are due together, or one once full."""

    def __init__(self, limits: WaitLimits) -> None:
        self._limits = limits
        self._pending: dict[Key, PendingRows] = {}
        self._frames = self._due = 0

    def add(self, path: str, columns: Columns, frame: int, stamp_ns: int, value: Any) -> None:
        """Append a row of this kind to the entity at ``path``."""
        rows = self._pending.get((path, columns))
        if rows is None:
            rows = self._pending[path, columns] = PendingRows(path, columns)
        rows.add(frame, stamp_ns, value)

    @property
    def size(self) -> int:
        """Bytes of images and text that wait."""
        return sum(rows.size for rows in self._pending.values())

    def end_frame(self) -> list[Key]:
        """Count a frame; return the keys whose rows have waited long enough, or are full."""
        self._frames += 1
        if self._frames - self._due >= self._limits.after(self._frames):
            self._due = self._frames
            return list(self._pending)
        return [key for key, rows in self._pending.items() if rows.size >= CHUNK_BYTES]

    def __iter__(self) -> Iterator[Key]:
        return iter(self._pending)

    def __getitem__(self, key: Key) -> PendingRows:
        return self._pending[key]

    def __delitem__(self, key: Key) -> None:
        del self._pending[key]


def _size(value: Any) -> int:
    """Return the bytes of an image, the letters of a text or of a note's two; 0 of a number."""
    if isinstance(value, tuple):
        return sum(map(_size, value))
    return len(value) if isinstance(value, bytes | str) else 0
