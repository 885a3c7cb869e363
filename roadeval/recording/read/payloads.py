"""Encoded images of an entity by frame, read ahead.

Rerun goes through all of an entity to give any frame of it. A pass a frame would take the square of
their number; so each pass keeps what lies around the frame, as much as fits in `READ_AHEAD`::

    pages of an entity    [ ][ ][b][b][f][a][a][ ][ ]
                                       the page with the frame is kept whatever its size,
                                       then those after it (a) as far as they fit,
                                       then the nearest before it (b) with the room that is left

Reading frames in order, forwards or backwards, then takes one pass for as many as fit.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
import pyarrow as pa

from roadeval.recording.layout import FRAME
from roadeval.recording.read.rrd_file import RrdFile, flat

READ_AHEAD: Final = 8 << 20
"""Bytes of an entity's payloads that are kept."""


class Page(NamedTuple):
    """Frames, and a payload for each."""

    frames: list[int]
    payloads: pa.ListArray


class PayloadCache:
    """Payloads of a file's entities; ``component`` is the one that carries an entity's."""

    def __init__(self, file: RrdFile) -> None:
        self._file = file
        self._frames: dict[str, frozenset[int]] = {}
        self._payloads: dict[str, dict[int, pa.ListScalar]] = {}

    def holds(self, path: str, component: str, frame: int) -> bool:
        """Return whether the file has a payload of the entity on a frame."""
        if path not in self._frames:
            self._read_around(path, component, frame)
        return frame in self._frames[path]

    def get(self, path: str, component: str, frame: int) -> bytes | None:
        """Return the payload of the entity on a frame; None if there is none."""
        if not self.holds(path, component, frame):
            return None
        if frame not in self._payloads[path]:
            self._read_around(path, component, frame)
        blob = self._payloads[path][frame]
        return bytes(np.from_dlpack(blob.values))

    def _read_around(self, path: str, component: str, frame: int) -> None:
        self._payloads.pop(path, None)
        pages = (
            Page(batch.column(FRAME).to_pylist(), flat(batch.column(component)))
            for batch in self._file.batches(path, component, static=False)
        )
        self._frames[path], self._payloads[path] = around(frame, pages)


def around(frame: int, pages: Iterable[Page]) -> tuple[frozenset[int], dict[int, pa.ListScalar]]:
    """Go through pages once and keep those around a frame; no more are ever held.

    Returns
    -------
    frozenset of int, dict
        All frames of the pages; and the payloads that are kept, by frame.
    """
    frames: set[int] = set()
    before: deque[Page] = deque()
    after: list[Page] = []
    for page in pages:
        frames.update(page.frames)
        if not after and frame not in page.frames:
            before.append(page)
        elif not after or _size(after) + page.payloads.nbytes <= READ_AHEAD:
            after.append(page)
        while before and _size(before) + _size(after) > READ_AHEAD:
            before.popleft()
    payloads = {
        number: payload
        for page in (*before, *after)
        for number, payload in zip(page.frames, page.payloads, strict=True)
    }
    return frozenset(frames), payloads


def _size(pages: Iterable[Page]) -> int:
    return sum(page.payloads.nbytes for page in pages)
