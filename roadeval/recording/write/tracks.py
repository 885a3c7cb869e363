"""Rows of one entity, gathered over frames and sent as one chunk.

A chunk costs about 1.1 kB in the file, 0.1 ms, and 1.5 to 3 kB of memory until the end: Rerun's
index of the file has a place for every component of the recording in every chunk's row. A chunk a
frame and entity would cost more than most of what it holds, and more with every minute.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from roadeval.recording.layout import COUNTS, FRAME, STAMP

Columns = Callable[[list[Any]], Any]
"""Makes the viewer's component columns of one value a row."""
Key = tuple[str, Columns]
"""A track: its entity's path, and the kind of its rows."""

NOTHING: Final = None
"""Stands for a row without a value: from there on the viewer shows nothing of the entity.

Rerun has `rerun.Clear` for that, which its viewer overlooks on encoded images:
https://github.com/rerun-io/rerun/issues/12793.
"""

CHUNK_BYTES: Final = 2 << 20
"""Of images and text at which a chunk is full, however few its frames: the viewer reads chunks
whole, and memory holds one several times while it is packed and written."""

SHARE: Final = 8
"""One frame in so many may wait, where `Patience` does not say otherwise: of a short recording few
do."""


@dataclass(frozen=True, slots=True)
class Patience:
    """For how many frames rows wait: a share of those so far, but from ``least`` to ``most``.

    A killed run loses what waits.
    """

    least: int
    most: int

    def after(self, frames: int) -> int:
        """Say for how many frames, when the recording has this many."""
        return min(max(frames // SHARE, self.least), self.most)


IMAGES_AND_WORDS: Final = Patience(8, 128)
"""Of what is read frame by frame: images, notes, states, table lines."""
NUMBERS: Final = Patience(64, 1024)
"""Of the graphs' numbers: many tracks of a few bytes a frame."""


class Track:
    """The pending rows of one entity."""

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
        """Give all rows as one chunk."""
        times = [
            rr.TimeColumn(FRAME, sequence=self._frames),
            rr.TimeColumn(STAMP, timestamp=np.array(self._stamps, "datetime64[ns]")),
        ]
        return Chunk.from_columns(self._path, times, self._filled())

    def _filled(self) -> Any:
        values = [value for value in self._values if value is not NOTHING]
        columns = self._columns(values)
        if len(values) == len(self._values):
            return columns
        return columns.partition([int(value is not NOTHING) for value in self._values])


class Tracks:
    """The tracks of a recording that wait alike: all end together, but one that is full at once."""

    def __init__(self, patience: Patience) -> None:
        self._patience = patience
        self._tracks: dict[Key, Track] = {}
        self._frames = self._ended = 0

    def add(self, path: str, columns: Columns, frame: int, stamp_ns: int, value: Any) -> None:
        """Append a row of this kind to the entity at ``path``."""
        track = self._tracks.get((path, columns))
        if track is None:
            track = self._tracks[path, columns] = Track(path, columns)
        track.add(frame, stamp_ns, value)

    @property
    def size(self) -> int:
        """Bytes of images and text that wait."""
        return sum(track.size for track in self._tracks.values())

    def turn(self) -> list[Key]:
        """End a frame; name the tracks that have waited long enough, or hold enough."""
        self._frames += 1
        if self._frames - self._ended >= self._patience.after(self._frames):
            self._ended = self._frames
            return list(self._tracks)
        return [key for key, track in self._tracks.items() if track.size >= CHUNK_BYTES]

    def __iter__(self) -> Iterator[Key]:
        """Name all tracks."""
        return iter(self._tracks)

    def __getitem__(self, key: Key) -> Track:
        """Give a track."""
        return self._tracks[key]

    def __delitem__(self, key: Key) -> None:
        """Drop a track; its entity's next row begins another."""
        del self._tracks[key]


def _size(value: Any) -> int:
    """Count the bytes of an image, the letters of a text or of a note's two; numbers take none."""
    if isinstance(value, tuple):
        return sum(map(_size, value))
    return len(value) if isinstance(value, bytes | str) else 0


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
