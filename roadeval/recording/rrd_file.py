"""A recording's file: opened whole, or, of a run that was killed, as far as it was written.

A Rerun file is a sequence of messages, each with a header; its index is the last one::

    RRF2  [header|message] [header|message] ...  [header|sums] [header|mark] [header|index]

Rerun has a checksum for the index alone. Of 400 random damages to messages two were read as other
numbers and three aborted the process, as Rerun's library does where it meets what it never expects.
So each message has a checksum, which is verified before it is read. The checksums are a document of
their own; its place and checksum are in the path of an entity (the *mark*), as the index lists
paths. In a file that another program has rewritten they no longer match, and are not used.

Rerun's compiled module reads the index, and a file without one: the package around it takes a third
of a second to import, and gives no access to the index.
"""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import inf
from mmap import ACCESS_READ, ALLOCATIONGRANULARITY, mmap
from pathlib import Path
from typing import Any, Final, NamedTuple
from zlib import crc32

import numpy as np
import pyarrow as pa
from rerun_bindings import (
    ChunkInternal,
    LazyChunkStreamInternal,
    LazyStoreInternal,
    RrdReaderInternal,
    StoreEntryInternal,
)

from roadeval.errors import RoadevalError
from roadeval.recording.layout import APPLICATION, FRAME, SUMS, DamagedError, RecordingError
from roadeval.runtime.files import check_input
from roadeval.runtime.text import is_utf8

_TEXT: Final = "TextDocument:text"
_BEGIN: Final = 12
"""Bytes before the first header."""
_HEADER: Final = struct.Struct("<QQ")
"""The kind of a message, and its length in bytes."""
_COMPRESSION, _SIZE, _CONTENT = 2, 3, 5
"""Fields of a message: how its content is packed, the size of what is unpacked, and the content."""
_BYTES: Final = 2
"""The kind of a field with a length; all others are one number."""
_LZ4: Final = 2
_MOST_PACKED: Final = 255
"""Bytes that LZ4 makes of one, at most: a message may claim any size."""
_PROBE: Final = """
import sys
from rerun.chunk import RrdReader
try:
    reader = RrdReader(sys.argv[1])
    for entry in reader.recordings():
        for chunk in reader.stream(store=entry):
            chunk.to_record_batch()
except Exception:
    pass
"""


class Span(NamedTuple):
    """Frames from the first to the last one, both included."""

    first: float = -inf
    last: float = inf

    def holds(self, frame: int) -> bool:
        """Whether a frame is one of them."""
        return self.first <= frame <= self.last


class Place(NamedTuple):
    """Where a message lies in the file, without its header, in bytes; and its frames."""

    offset: int
    size: int
    static: bool
    """Whether it was logged once, for every frame."""
    span: Span


class RrdFile:
    """An ``.rrd`` file by this program.

    A `RecordingError` if there is none, or it is not a recording by this program.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.below = ""
        """The path below which all entities are looked for."""
        self._reader, self._entry = _open(path)
        self._store = _store(self._reader, self._entry)
        with whole(path, "its index"):
            self._places = {} if self._store is None else _places(self._store)
        self._sums = self._read_sums()

    @property
    def indexed(self) -> bool:
        """Whether it has an index, which is written last: without one the run was killed."""
        return self._store is not None

    def stream(self) -> LazyChunkStreamInternal:
        """Return all chunks; without an index the whole file is read, as far as it goes."""
        if self._store is not None:
            return self._store.stream()
        return self._reader.stream(store=self._entry)

    def batches(self, path: str, component: str, *, static: bool) -> Iterator[pa.RecordBatch]:
        """Yield the rows of an entity that have a value, a batch a chunk.

        A `DamagedError` if they are not what was written.
        """
        path = self.below + path
        if self._places:
            found = [each for each in self._places.get(path, ()) if each.static == static]
            yield from self._at(path, component, found)
            return
        chunks = self.stream().filter(content=[path], components=[component], is_static=static)
        for chunk in self._all(chunks, path):
            with whole(self.path, path):
                batch = _filled(chunk.to_record_batch(), component)
            if len(batch):
                yield batch

    def around(
        self, path: str, component: str, frame: int
    ) -> tuple[Span, Iterable[pa.RecordBatch]]:
        """Return the rows of an entity in the chunks with a frame, and the frames of these.

        Without an index these are all chunks. A `DamagedError` if they are not what was written.
        """
        if not self._places:
            return Span(), self.batches(path, component, static=False)
        path = self.below + path
        places = [each for each in self._places.get(path, ()) if not each.static]
        here = [each for each in places if each.span.holds(frame)]
        if not here:
            before = max((p.span.last for p in places if p.span.last < frame), default=-inf)
            after = min((p.span.first for p in places if p.span.first > frame), default=inf)
            return Span(before + 1, after - 1), ()
        first = max(each.span.first for each in here)
        span = Span(first, min(each.span.last for each in here))
        return span, self._at(path, component, here)

    def _at(self, path: str, component: str, places: Sequence[Place]) -> Iterator[pa.RecordBatch]:
        """Yield the rows with a value of an entity's messages, read by their places alone."""
        for place in places:
            with self.path.open("rb") as file:
                file.seek(place.offset)
                message = file.read(place.size)
            if self._sums and self._sums.get(place.offset) != crc32(message):
                raise DamagedError(self.path, path)
            with whole(self.path, path):
                batch = unpacked(message)
                batch = _filled(batch, component) if component in batch.schema.names else ()
            if len(batch):
                yield batch

    def rows(self, path: str, component: str) -> Iterator[tuple[int, Any]]:
        """Yield the frame and the value of each row."""
        for batch in self.batches(path, component, static=False):
            with whole(self.path, path):
                values = flat(batch.column(component)).to_pylist()
                rows = list(zip(batch.column(FRAME).to_pylist(), values, strict=True))
            yield from rows

    def texts(self, path: str) -> Iterator[str]:
        """Yield the documents that were logged frame by frame."""
        return (text for _, text in self.rows(path, _TEXT))

    def document(self, path: str) -> str | None:
        """Return the document that was logged once; None if the run ended before it."""
        value = self.static(path, _TEXT)
        return None if value is None else str(value)

    def static(self, path: str, component: str) -> Any:
        """Return the value that was logged once; None if there is none."""
        for batch in self.batches(path, component, static=True):
            with whole(self.path, path):
                return flat(batch.column(component))[0].as_py()
        return None

    def _read_sums(self) -> dict[int, int]:
        """Return the checksums of the messages by their offsets.

        A file without any, as that of a killed run, is read once by another process first: it may
        hold what would abort this one.
        """
        with whole(self.path, "its index"):
            self._sums = marked(self._places)
        if not self._sums:
            if not can_be_read(self.path):
                raise DamagedError(self.path, "a place beyond which Rerun cannot read")
            return {}
        with whole(self.path, SUMS):
            pairs = json.loads(self.document(SUMS) or "")
            return {int(offset): int(total) for offset, total in pairs}

    def _all(self, chunks: LazyChunkStreamInternal, path: str) -> Iterator[ChunkInternal]:
        """Yield chunks; a `DamagedError` where one cannot be unpacked."""
        with whole(self.path, path):
            found = iter(chunks)
        while True:
            with whole(self.path, path):
                chunk = next(found, None)
            if chunk is None:
                return
            yield chunk


@contextmanager
def whole(path: Path, part: str) -> Iterator[None]:
    """Turn any exception while a part of a file is unpacked into a `DamagedError`.

    Rerun, Arrow, JSON and the decoders of images each have exceptions of their own.
    """
    try:
        yield
    except (RoadevalError, MemoryError):
        raise
    except Exception as error:
        raise DamagedError(path, part) from error


def flat(lists: pa.ListArray) -> pa.Array:
    """Return the values of lists, none of which is null, one after the other."""
    # Arrow's own way imports everything that it can compute.
    begin, end = (lists.offsets[place].as_py() for place in (0, -1))
    return lists.values.slice(begin, end - begin)


def unpacked(message: bytes) -> pa.RecordBatch:
    """Return the rows of a message of the file: Protocol Buffers, in which LZ4 packs Arrow's own.

    An error of any kind if it is damaged. Rerun itself goes through the whole entity for any row of
    it, or aborts at damage.
    """
    import lz4.block

    fields: dict[int, Any] = {}
    at = 0
    while at < len(message):
        tag, at = _varint(message, at)
        number, at = _varint(message, at)
        fields[tag >> 3] = number
        if tag & 7 == _BYTES:
            fields[tag >> 3], at = message[at : at + number], at + number
    content = fields[_CONTENT]
    if fields.get(_COMPRESSION) == _LZ4:
        if fields[_SIZE] > _MOST_PACKED * len(content):
            raise ValueError("a size that cannot be")
        content = lz4.block.decompress(content, uncompressed_size=fields[_SIZE])
    return pa.ipc.open_stream(content).read_next_batch()


def _varint(message: bytes, at: int) -> tuple[int, int]:
    """Return the number that begins at a byte, seven bits a byte, and where it ends."""
    number = shift = 0
    while message[at] & 0x80:
        number |= (message[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
    return number | message[at] << shift, at + 1


def _filled(batch: pa.RecordBatch, component: str) -> pa.RecordBatch:
    """Return the rows with a value: one without says that from there on nothing is shown."""
    values = batch.column(component)
    if not values.null_count and np.diff(np.from_dlpack(values.offsets)).all():
        return batch
    import pyarrow.compute as pc

    lengths = pc.fill_null(pc.list_value_length(values), 0)
    return batch.filter(pc.greater(lengths, 0))


def indexed_chunks(path: Path) -> int:
    """Return how many chunks a recording's own index lists; 0 if it has no index."""
    try:
        store = _store(*_open(path))
    except RecordingError:
        return 0
    return 0 if store is None else int(store.num_chunks())


def _open(path: Path) -> tuple[RrdReaderInternal, StoreEntryInternal]:
    try:
        check_input(path)
    except FileNotFoundError as error:
        raise RecordingError(f"{path}: no such recording") from error
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from error
    if not is_utf8(str(path)):
        raise RecordingError(
            f"{path}: Rerun reads no file whose name is not UTF-8: rename it, or set PYTHONUTF8=1 "
            "where the system speaks another encoding"
        )
    try:
        with warnings.catch_warnings():
            # That a partial recording has no index is known by `RrdFile.indexed`.
            warnings.simplefilter("ignore")
            reader = RrdReaderInternal(str(path))
            entries = [each for each in reader.store_entries() if each.kind == "recording"]
    except RuntimeError as error:
        raise RecordingError(_reason(path)) from error
    for entry in entries:
        if entry.application_id == APPLICATION:
            return reader, entry
    made_by = entries[0].application_id if entries else "an unknown program"
    raise RecordingError(f"{path}: a recording by {made_by}, not by {APPLICATION}")


def _store(reader: RrdReaderInternal, entry: StoreEntryInternal) -> LazyStoreInternal | None:
    try:
        return reader.store(store=entry)
    except RuntimeError:
        return None


def _places(store: LazyStoreInternal) -> dict[str, list[Place]]:
    """Return where the messages of every entity lie, by its path, as the index says."""
    _, index = store._chunk_index()
    names = ["entity_path", "byte_offset", "byte_size", "is_static"]
    names = [f"chunk_{name}" for name in names]
    names += [name for name in (f"{FRAME}:start", f"{FRAME}:end") if name in index.schema.names]
    places: dict[str, list[Place]] = {}
    rows = zip(*(index.column(name).to_pylist() for name in names), strict=True)
    for path, offset, size, static, *frames in rows:
        span = Span() if static or not frames else Span(*frames)
        places.setdefault(path, []).append(Place(offset, size, static, span))
    for own in places.values():
        own.sort(key=lambda place: (place.span.first, place.offset))
    return places


def _reason(path: Path) -> str:
    with path.open("rb") as file:
        if file.read(4) != b"RRF2":
            return f"{path}: not a recording (.rrd); 'roadeval replay' makes one of a log"
    return (
        f"{path}: the recording is torn; "
        f"'rerun rrd optimize --continue-on-error {path} -o repaired.rrd' keeps what is whole"
    )


class MessageSums:
    """The checksums of the messages of a file that is being written."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._next = _BEGIN
        self._sums: list[tuple[int, int]] = []

    def read_on(self) -> None:
        """Take in what was written to the file since the last call.

        Its pages are looked at where the system holds them: a copy would take as long again.
        """
        begin = self._next - self._next % ALLOCATIONGRANULARITY
        with self._path.open("rb") as file:
            size = file.seek(0, 2) - begin
            if size <= self._next - begin:
                return
            with mmap(file.fileno(), size, offset=begin, access=ACCESS_READ) as written:
                self._take(memoryview(written), begin)

    def _take(self, written: memoryview, begin: int) -> None:
        """Take in the whole messages of what was written from the byte ``begin`` on."""
        with written:
            while (at := self._next - begin + _HEADER.size) <= len(written):
                _, size = _HEADER.unpack_from(written, at - _HEADER.size)
                if at + size > len(written):
                    return
                with written[at : at + size] as message:
                    self._sums.append((begin + at, crc32(message)))
                self._next = begin + at + size

    def document(self) -> str:
        """Return all checksums, each with the offset of its message, as JSON."""
        return json.dumps(self._sums)

    def mark(self) -> str:
        """Return the path of the entity that says where the last message lies, and its checksum."""
        offset, total = self._sums[-1]
        return f"{SUMS}/{offset}_{total:08x}"


def marked(places: Mapping[str, Sequence[Place]]) -> dict[int, int]:
    """Return the checksum of the document of checksums by its offset, from a recording's paths.

    Empty for a file that a killed run has left, or that another program has rewritten.
    """
    own = [place.offset for place in places.get(SUMS, ())]
    marks = [path.rpartition("/")[2] for path in places if path.startswith(f"{SUMS}/")]
    found = {int(place): int(total, 16) for place, _, total in (m.partition("_") for m in marks)}
    return found if own == [*found] else {}


def can_be_read(path: Path) -> bool:
    """Return whether Rerun reads a whole file without aborting, which another process tries."""
    # -P: a rerun.py that lies beside the recordings must not be imported.
    probe = [sys.executable, "-P", "-c", _PROBE, str(path)]
    return subprocess.run(probe, check=False, capture_output=True).returncode == 0
