"""Rows of an entity, gathered over frames and sent as one chunk.

A chunk costs about 1.1 kB in the file, 0.1 ms, and 1.5 to 3 kB of memory until the end, because
Rerun's index has a cell for every component of the recording in every chunk's row. With a chunk for
each frame and entity most chunks would cost more than their content.

Rerun can batch by itself (`rerun.ChunkBatcherConfig`), but takes 2.7 ms a frame more on the demo,
and limits neither the rows that a killed run loses nor the memory of rows that wait.
"""

from __future__ import annotations

from collections.abc import Callable
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
"""A row without a value: from this frame on the viewer shows nothing of the entity.

`rerun.Clear` has no effect on encoded images: https://github.com/rerun-io/rerun/issues/12793.
"""

CHUNK_BYTES: Final = 1 << 19
"""Bytes of images and text at which a chunk is full. All of it is read even for one picture, and it
is held in memory several times while it is packed and written."""

SHARE: Final = 8
"""The rows of at most one in so many recorded frames wait. A killed run loses them."""
IMAGES_AND_TEXT: Final = (8, MOST_WAITING)
"""Least and greatest number of frames for which images, notes, states and table lines wait."""
NUMBERS: Final = (64, 1024)
"""The same for the graphs' numbers: many entities with a few bytes a frame each."""


class PendingRows:
    """Rows of one entity that wait to be sent."""

    def __init__(self, path: str, columns: Columns, header_time: str = HEADER_TIME) -> None:
        self._path, self._columns, self._header_time = path, columns, header_time
        self._rows: list[tuple[When, Any]] = []
        self.size = 0

    def add(self, when: When, value: Any) -> None:
        """Append a row of a frame; its value may be `NOTHING`."""
        self._rows.append((when, value))
        self.size += _size(value)

    def chunk(self) -> Chunk:
        """Return all rows as one chunk."""
        whens, values = zip(*self._rows, strict=True)
        frames, stamps, logged = np.array(whens).T
        named = zip((STAMP, self._header_time, LOG_TIME), (stamps, stamps, logged), strict=True)
        timelines = [
            rr.TimeColumn(FRAME, sequence=frames),
            *(rr.TimeColumn(n, timestamp=times.astype("datetime64[ns]")) for n, times in named),
        ]
        columns = self._columns([value for value in values if value is not NOTHING])
        if NOTHING in values:
            columns = columns.partition([int(value is not NOTHING) for value in values])
        return Chunk.from_columns(self._path, timelines, columns)


class Batcher(dict[Key, PendingRows]):
    """Waiting rows of entities, sent together; a full chunk earlier.

    ``limits`` are the least and the greatest number of frames for which they may wait.
    """

    def __init__(self, limits: tuple[int, int], header_time: str = HEADER_TIME) -> None:
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
        """Count a frame; return the keys of the rows that must now be sent."""
        self._frames += 1
        least, most = self._limits
        if self._frames - self._due >= min(max(self._frames // SHARE, least), most):
            self._due = self._frames
            return list(self)
        return [key for key, rows in self.items() if rows.size >= CHUNK_BYTES]


def _size(value: Any) -> int:
    """Return the size of an image or of texts, in bytes or letters; 0 for a number."""
    if isinstance(value, tuple):
        return sum(map(_size, value))
    return len(value) if isinstance(value, bytes | str) else 0


def numbers(values: list[tuple[float, ...]]) -> Any:
    """Return columns with one number a row, or with several as `layout.COUNTS` has them."""
    flat = np.array(values, np.float64)
    return rr.Scalars.columns(scalars=flat.ravel()).partition([flat.shape[1]] * len(flat))


def states(values: list[str]) -> Any:
    """Return columns of states that begin, one a row; an empty text ends a state."""
    return rr.StateChange.columns(state=values)


def texts(values: list[str]) -> Any:
    """Return columns of one document a row."""
    return rr.TextDocument.columns(text=values)


def notes(values: list[tuple[str, str]]) -> Any:
    """Return columns of one sentence and its level a row."""
    sentences, levels = zip(*values, strict=True)
    return rr.TextLog.columns(text=list(sentences), level=list(levels))
