"""Rerun back in: tables, arrays and notes of a recording, whole or partial, without the log."""

from __future__ import annotations

import json
import warnings
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
from rerun.chunk import LazyChunkStream, LazyStore, RrdReader, StoreEntry

from roadeval.data import ERRORS, TRUTH, VariantLayout
from roadeval.recording import layout as at
from roadeval.recording.codecs import Codec, LabelCodec
from roadeval.recording.layout import Layout, RecordingError
from roadeval.recording.write.encoding import Encoder
from roadeval.recording.write.tracks import IMAGES_AND_WORDS
from roadeval.results.reading import read_table

if TYPE_CHECKING:
    import pandas as pd

READ_AHEAD: Final = 8 << 20
"""Bytes of an entity's payloads that are kept, once the whole of it had to be gone through."""

_Page = tuple[list[int], pa.ListArray]
"""Frames, and a payload for each."""

_TEXT = "TextDocument:text"
_CAMERA = "EncodedImage:blob"
_FORMAT = "format"


class Recording:
    """A recording on disk.

    A partial one, of a run that was interrupted or killed, is read as far as it goes: then
    ``complete`` is False, and ``summary`` and ``windows`` may be empty.

    Parameters
    ----------
    path
        An ``.rrd`` file that `Recorder` wrote.

    Raises
    ------
    RecordingError
        If it is none, or one by a later version.

    Attributes
    ----------
    format
        Version of the arrangement inside the file, see `roadeval.recording.layout.FORMAT`.

    Examples
    --------
    >>> recording = Recording("out.rrd")                                   # doctest: +SKIP
    >>> recording.frames.query("stage == 'post'").ERR.mean()               # doctest: +SKIP
    >>> mask = recording.layer("filtered", "post", frame=42)               # doctest: +SKIP
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = Path(path)
        self._reader, self._entry = _open(self.path)
        self._store = _store(self._reader, self._entry)
        self.format = self._format()
        if self.format > at.FORMAT:
            raise RecordingError(f"{self.path}: made by a later version of roadeval: update it")
        text = self._document(at.LAYOUT)
        if text is None:
            raise RecordingError(f"{self.path}: the recording ends before its first frame")
        self.layout = Layout.from_json(text)
        self._codecs = self._codecs_then()
        self._held: dict[str, frozenset[int]] = {}
        self._payloads: dict[str, dict[int, pa.ListScalar]] = {}

    # --- What it holds ---------------------------------------------------------------------------

    @property
    def complete(self) -> bool:
        """Whether the run reached its end."""
        return self._store is not None and self.result(at.SUMMARY) is not None

    @property
    def variants(self) -> tuple[VariantLayout, ...]:
        """The variants with their stages and layers; the baseline is none of them."""
        return self.layout.variants

    @cached_property
    def frame_numbers(self) -> tuple[int, ...]:
        """The frames whose images are there, in order."""
        batches = self._batches(at.CAMERA, _CAMERA, static=False)
        return tuple(frame for batch in batches for frame in batch.column(at.FRAME).to_pylist())

    @property
    def unsure(self) -> tuple[int, ...]:
        """The last frames of a partial recording, of which a killed run may lack some layers."""
        return () if self.complete else self.frame_numbers[-IMAGES_AND_WORDS.most :]

    @cached_property
    def roles(self) -> dict[int, str]:
        """What each frame was used for, see `roadeval.data.Role`.

        A killed run may not have written what it knew of its last frames: theirs is an earlier
        one's then.
        """
        changes = dict(self._rows(at.ROLE, "StateChange:state"))
        roles, role = {}, ""
        for frame in self.frame_numbers:
            role = roles[frame] = str(changes.get(frame, role))
        return roles

    # --- Results ---------------------------------------------------------------------------------

    def result(self, name: str) -> str | None:
        """Give the text of a result, as ``summary``; None if the run did not get there."""
        return self._document(at.result_path(name))

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The content of ``summary.json``."""
        summary = dict(json.loads(self.result(at.SUMMARY) or "{}"))
        seconds = json.loads(self._document(at.SECONDS) or "{}")
        return summary | ({"seconds": seconds} if seconds else {})

    @cached_property
    def frames(self) -> pd.DataFrame:
        """The rows of ``frames.csv``."""
        return self.table("frames")

    @cached_property
    def regions(self) -> pd.DataFrame:
        """The rows of ``regions.csv``."""
        return self.table("regions")

    @cached_property
    def windows(self) -> pd.DataFrame:
        """The rows of ``windows.csv``."""
        return self.table("windows")

    def table(self, name: str) -> pd.DataFrame:
        """Give the rows of a table by its name, as ``oracles``; none if the run counted none."""
        if name in self.layout.tables:
            lines = (lines for _, lines in self._rows(at.result_path(name), _TEXT))
            text = "".join((self.layout.tables[name].rstrip(), "\n", *lines))
        else:
            text = self.result(name) or ""
        return read_table(name, text, self.summary)

    def scalars(self, path: str) -> pd.Series[float]:
        """Give the numbers under an entity path, as ``/timing/filtered/svm``, by frame number."""
        import pandas as pd

        rows = dict(self._rows(path, "Scalars:scalars"))
        return pd.Series(rows, name=path, dtype=float).rename_axis(at.FRAME)

    def notes(self, frame: int) -> tuple[str, ...]:
        """Say what there is to say about a frame."""
        return self._notes.get(frame, ())

    # --- Images ----------------------------------------------------------------------------------

    def image(self, frame: int) -> npt.NDArray[np.uint8]:
        """Give the camera's image, ``(H, W, 3)`` uint8 RGB."""
        return self._array(at.CAMERA, frame)

    def truth(self, frame: int) -> npt.NDArray[np.uint8]:
        """Give the truth, ``(H, W)`` uint8: 0 non-road, 1 road, 255 ignored."""
        return self._array(at.TRUTH_PATH, frame)

    def layer(self, variant: str, name: str, frame: int) -> npt.NDArray[Any]:
        """Give a layer of a variant on a frame.

        Returns
        -------
        array
            Masks and labels: ``(H, W)`` uint8, as the stage made them. Maps of numbers:
            ``(H, W)`` float32 in their own unit. Images: ``(H, W, 3)`` uint8 RGB.

        Raises
        ------
        RecordingError
            If there is no such layer, or not on this frame.
        """
        return self._array(at.layer_path(variant, name), frame)

    def is_whole(self, frame: int, *, scored: bool) -> bool:
        """Tell whether all masks of a frame are there, and if it was scored truth and errors."""
        layers = [(v.name, stage) for v in self.variants for stage in v.stages]
        layers += [(v.name, ERRORS.name) for v in self.variants if scored]
        paths = (at.CAMERA, *(at.layer_path(*layer) for layer in layers))
        return all(self._holds(path, frame) for path in (*paths, *[at.TRUTH_PATH] * scored))

    # --- How -------------------------------------------------------------------------------------

    @cached_property
    def _notes(self) -> dict[int, tuple[str, ...]]:
        notes: dict[int, tuple[str, ...]] = {}
        for frame, note in self._rows(at.NOTES, "TextLog:text"):
            notes[frame] = (*notes.get(frame, ()), note)
        return notes

    def _array(self, path: str, frame: int) -> npt.NDArray[Any]:
        if path not in self._codecs:
            known = ", ".join(sorted(self._codecs))
            raise RecordingError(f"{self.path}: there is no {path}; there are {known}")
        codec = self._codecs[path]
        if frame not in self._payloads.get(path, {}):
            self._read_ahead(path, codec.component, frame)
        return codec.decode(_bytes(self._payloads[path][frame]))

    def _read_ahead(self, path: str, component: str, frame: int) -> None:
        """Take in the payloads of this frame and of those around it, see `_around`.

        Rerun reads all of an entity to give any of it: one pass a frame would take the square of
        their number, and reading ahead divides that by the number of frames that fit.
        """
        if frame in self._held.get(path, (frame,)):
            self._payloads.pop(path, None)
            pages = (
                (batch.column(at.FRAME).to_pylist(), batch.column(component).flatten())
                for batch in self._batches(path, component, static=False)
            )
            self._held[path], self._payloads[path] = _around(frame, pages)
        if frame not in self._held[path]:
            raise RecordingError(f"{self.path}: {path} has nothing on frame {frame}")

    def _holds(self, path: str, frame: int) -> bool:
        if path not in self._held:
            with suppress(RecordingError):
                self._read_ahead(path, self._codecs[path].component, frame)
        return frame in self._held[path]

    def _rows(self, path: str, component: str) -> Iterator[tuple[int, Any]]:
        for batch in self._batches(path, component, static=False):
            values = batch.column(component).flatten()
            yield from zip(batch.column(at.FRAME).to_pylist(), values.to_pylist(), strict=True)

    def _codecs_then(self) -> dict[str, Codec]:
        """Give the codecs with which a recording of this format was made."""
        layout = self.layout
        codecs = Encoder(layout).codecs
        if self.format < 3:
            codecs |= {
                path: LabelCodec(spec, layout.width, layout.height)
                for path, spec in layout.images()
                if spec in (TRUTH, at.SHADOW_TRUTH, ERRORS)
            }
        return codecs

    def _format(self) -> int:
        for batch in self._batches(at.PROPERTIES, _FORMAT, static=True):
            return int(batch.column(_FORMAT).flatten()[0].as_py())
        return 1

    def _document(self, path: str) -> str | None:
        for batch in self._batches(path, _TEXT, static=True):
            return str(batch.column(_TEXT).flatten()[0])
        return None

    def _batches(self, path: str, component: str, *, static: bool) -> Iterator[pa.RecordBatch]:
        chunks = self._stream().filter(content=path, components=component, is_static=static)
        for chunk in chunks:
            batch = chunk.to_record_batch()
            # A row without a value says that from there on nothing is shown.
            lengths = pc.fill_null(pc.list_value_length(batch.column(component)), 0)
            filled = pc.greater(lengths, 0)
            if pc.any(filled).as_py():
                yield batch if pc.all(filled).as_py() else batch.filter(filled)

    def _stream(self) -> LazyChunkStream:
        if self._store is not None:
            return self._store.stream()
        return self._reader.stream(store=self._entry)


def indexed_chunks(path: Path) -> int:
    """Count the chunks that a recording's own index lists; 0 if it has no index."""
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
            # A partial recording has no index; that it is partial is told by `complete`.
            warnings.simplefilter("ignore")
            reader = RrdReader(path)
            entries = reader.recordings()
    except RuntimeError as error:
        raise RecordingError(_reason(path)) from error
    for entry in entries:
        if entry.application_id == at.APPLICATION:
            return reader, entry
    made_by = entries[0].application_id if entries else "an unknown program"
    raise RecordingError(f"{path}: a recording by {made_by}, not by {at.APPLICATION}")


def _reason(path: Path) -> str:
    with path.open("rb") as file:
        if file.read(4) != b"RRF2":
            return f"{path}: not a recording (.rrd)"
    return (
        f"{path}: the recording is torn; "
        f"'rerun rrd optimize --continue-on-error {path} -o repaired.rrd' keeps what is whole"
    )


def _bytes(blob: pa.ListScalar) -> bytes:
    return bytes(blob.values.to_numpy())  # noqa: PD011 - Arrow's values, not pandas'


def _around(frame: int, pages: Iterable[_Page]) -> tuple[frozenset[int], dict[int, pa.ListScalar]]:
    """Go through pages once and keep those around a frame; no more are ever held.

    Returns
    -------
    frozenset of int, dict
        All frames of the pages; and payloads by frame: those of the page with this frame, whatever
        its size, of those after it as far as they fit, and of the nearest before it with what is
        left of `READ_AHEAD`.
    """
    there: set[int] = set()
    near: deque[_Page] = deque()
    size = ahead = 0
    for page in pages:
        numbers, blobs = page
        there.update(numbers)
        if ahead and ahead + blobs.nbytes > READ_AHEAD:
            continue
        near.append(page)
        size += blobs.nbytes
        if ahead or frame in numbers:
            ahead += blobs.nbytes
        while size > max(READ_AHEAD, ahead):
            size -= near.popleft()[1].nbytes
    payloads = {
        number: blob for numbers, blobs in near for number, blob in zip(numbers, blobs, strict=True)
    }
    return frozenset(there), payloads


def _store(reader: RrdReader, entry: StoreEntry) -> LazyStore | None:
    try:
        return reader.store(store=entry)
    except RuntimeError:
        return None
