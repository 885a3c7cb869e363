"""A recording's file: opened whole, or, of a run that was killed, as far as it was written."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.compute as pc
from rerun.chunk import LazyChunkStream, LazyStore, RrdReader, StoreEntry

from roadeval.recording.layout import APPLICATION, FRAME, RecordingError

_TEXT: Final = "TextDocument:text"


class RrdFile:
    """An ``.rrd`` file by this program.

    Parameters
    ----------
    path
        Of the file.

    Raises
    ------
    RecordingError
        If there is none, or it is not a recording by this program.
    """

    def __init__(self, path: Path) -> None:
        self._reader, self._entry = _open(path)
        self._store = _store(self._reader, self._entry)

    @property
    def indexed(self) -> bool:
        """Whether it has an index, which is written last: without one the run was killed."""
        return self._store is not None

    def stream(self) -> LazyChunkStream:
        """Return all chunks; without an index the whole file is read, as far as it goes."""
        if self._store is not None:
            return self._store.stream()
        return self._reader.stream(store=self._entry)

    def batches(self, path: str, component: str, *, static: bool) -> Iterator[pa.RecordBatch]:
        """Yield the rows of an entity that have a value, in as many batches as there are chunks."""
        chunks = self.stream().filter(content=path, components=component, is_static=static)
        for chunk in chunks:
            batch = chunk.to_record_batch()
            # A row without a value says that from there on nothing is shown.
            lengths = pc.fill_null(pc.list_value_length(batch.column(component)), 0)
            filled = pc.greater(lengths, 0)
            if pc.any(filled).as_py():
                yield batch if pc.all(filled).as_py() else batch.filter(filled)

    def rows(self, path: str, component: str) -> Iterator[tuple[int, Any]]:
        """Yield the frame and the value of each row."""
        for batch in self.batches(path, component, static=False):
            values = batch.column(component).flatten()
            yield from zip(batch.column(FRAME).to_pylist(), values.to_pylist(), strict=True)

    def texts(self, path: str) -> Iterator[str]:
        """Yield the documents that were logged frame by frame."""
        return (text for _, text in self.rows(path, _TEXT))

    def document(self, path: str) -> str | None:
        """Return the document that was logged once; None if the run did not get there."""
        value = self.static(path, _TEXT)
        return None if value is None else str(value)

    def static(self, path: str, component: str) -> Any:
        """Return the value that was logged once; None if there is none."""
        for batch in self.batches(path, component, static=True):
            return batch.column(component).flatten()[0].as_py()
        return None


def indexed_chunks(path: Path) -> int:
    """Return how many chunks a recording's own index lists; 0 if it has no index."""
    try:
        store = _store(*_open(path))
    except RecordingError:
        return 0
    return 0 if store is None else len(store)


def _open(path: Path) -> tuple[RrdReader, StoreEntry]:
    if not path.is_file():
        raise RecordingError(f"{path}: no such recording")
    try:
        with warnings.catch_warnings():
            # That a partial recording has no index is known by `RrdFile.indexed`.
            warnings.simplefilter("ignore")
            reader = RrdReader(path)
            entries = reader.recordings()
    except RuntimeError as error:
        raise RecordingError(_reason(path)) from error
    for entry in entries:
        if entry.application_id == APPLICATION:
            return reader, entry
    made_by = entries[0].application_id if entries else "an unknown program"
    raise RecordingError(f"{path}: a recording by {made_by}, not by {APPLICATION}")


def _store(reader: RrdReader, entry: StoreEntry) -> LazyStore | None:
    try:
        return reader.store(store=entry)
    except RuntimeError:
        return None


def _reason(path: Path) -> str:
    with path.open("rb") as file:
        if file.read(4) != b"RRF2":
            return f"{path}: not a recording (.rrd)"
    return (
        f"{path}: the recording is torn; "
        f"'rerun rrd optimize --continue-on-error {path} -o repaired.rrd' keeps what is whole"
    )
