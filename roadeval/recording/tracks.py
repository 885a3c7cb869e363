"""Rows of one entity, gathered over frames and sent as one chunk.

A chunk costs about 1.1 kB in the file, 0.5 kB of memory until the end (the file's index) and
0.1 ms, so a chunk a frame and entity would cost more than most of what it holds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from roadeval.recording.layout import COUNTS, FRAME, STAMP

Columns = Callable[[list[Any]], Any]
"""Makes the viewer's component columns of one value a row."""

NOTHING: Final = None
"""Stands for a row without a value: from there on the viewer shows nothing of the entity.

Rerun has `rerun.Clear` for that, which its viewer overlooks on encoded images:
https://github.com/rerun-io/rerun/issues/12793.
"""


class Track:
    """The pending rows of one entity."""

    def __init__(self, path: str, columns: Columns) -> None:
        self._path = path
        self._columns = columns
        self._frames: list[int] = []
        self._stamps: list[int] = []
        self._values: list[Any] = []

    def add(self, frame: int, stamp_ns: int, value: Any) -> None:
        """Append a row, perhaps with `NOTHING`, at this frame number and header stamp."""
        self._frames.append(frame)
        self._stamps.append(stamp_ns)
        self._values.append(value)

    def take(self) -> Chunk | None:
        """Give away the pending rows as one chunk; None if there are none."""
        if not self._frames:
            return None
        times = [
            rr.TimeColumn(FRAME, sequence=self._frames),
            rr.TimeColumn(STAMP, timestamp=np.array(self._stamps, "datetime64[ns]")),
        ]
        chunk = Chunk.from_columns(self._path, times, self._filled())
        self._frames, self._stamps, self._values = [], [], []
        return chunk

    def _filled(self) -> Any:
        values = [value for value in self._values if value is not NOTHING]
        columns = self._columns(values)
        if len(values) == len(self._values):
            return columns
        return columns.partition([int(value is not NOTHING) for value in self._values])


class Tracks:
    """Tracks that are sent together, made when their first row comes."""

    def __init__(self) -> None:
        self._tracks: dict[tuple[str, Columns], Track] = {}

    def add(self, path: str, columns: Columns, frame: int, stamp_ns: int, value: Any) -> None:
        """Append a row of this kind to the entity at ``path``."""
        if (path, columns) not in self._tracks:
            self._tracks[path, columns] = Track(path, columns)
        self._tracks[path, columns].add(frame, stamp_ns, value)

    def take(self) -> list[Chunk]:
        """Give away all pending rows."""
        chunks = (track.take() for track in self._tracks.values())
        return [chunk for chunk in chunks if chunk is not None]


def scalars(values: list[float]) -> Any:
    """Log one number a row."""
    return rr.Scalars.columns(scalars=values)


def counts(values: list[tuple[int, ...]]) -> Any:
    """Log the numbers of `layout.COUNTS` a row."""
    flat = np.array(values, np.float64).ravel()
    return rr.Scalars.columns(scalars=flat).partition([len(COUNTS)] * len(values))


def states(values: list[str]) -> Any:
    """Begin a state, or end one with an empty text, a row."""
    return rr.StateChange.columns(state=values)


def texts(values: list[str]) -> Any:
    """Log a document a row."""
    return rr.TextDocument.columns(text=values)


def notes(values: list[tuple[str, str]]) -> Any:
    """Log a sentence and its level a row."""
    sentences, levels = zip(*values, strict=True)
    return rr.TextLog.columns(text=list(sentences), level=list(levels))
