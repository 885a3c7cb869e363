"""A recording's file: the rows of its entities, of a killed run as far as they were written.

A Rerun file is a sequence of messages, each with a header; the index is the last one::

    RRF2  [header|message] [header|message] ...  [header|index] [where the index lies]

A message holds rows of one entity, and is read by its place alone.

This module is a fence: nothing else knows the bytes of the format. Rerun's public reader,
`rerun.chunk.RrdReader`, gives the same rows of a sound file (``tests/recording/test_rrd_file``).
But it ended the process on two of 320 files of which a few random bytes were changed, and stopped
at the damage in nearly all others; here every sound frame is read, and the rest is one line
(``tests/recording/test_damage``). To read a table takes half the CPU time here, 0.27 s for 0.55 s,
because Rerun is not imported.
"""

from __future__ import annotations

import struct
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

import numpy as np
import pyarrow as pa

from roadeval.errors import RoadevalError
from roadeval.recording.layout import APPLICATION, FRAME, LAYOUT, DamagedError, RecordingError
from roadeval.runtime.documents import protobuf_fields
from roadeval.runtime.files import check_input

TEXT: Final = "TextDocument:text"
_MAGIC: Final = b"RRF2"
_BEGIN: Final = 12
"""Bytes before the first header."""
_HEADER: Final = struct.Struct("<QQ")
"""The kind of a message, and its length in bytes."""
_LAST, _ROWS = 0, 2
"""The kinds of the last message, and of one with rows."""
_END: Final = struct.Struct("<QQI8sI")
"""The place of the index and its length; a checksum, `_END_MAGIC` and a version."""
_END_MAGIC: Final = b"RRF2FOOT"
_STORE, _COMPRESSION, _SIZE, _CONTENT = 1, 2, 3, 5
"""Fields of a message: the recording or blueprint that it belongs to, how its content is packed,
the size of what is unpacked, and the content."""
_INDEX: Final = 4
"""The field of a store's part of the index that lists its messages, with fields of its own: the
content, how it is packed, and the size of what is unpacked."""
_RECORDING: Final = 1
"""The kind of a store that is no blueprint."""
_LZ4: Final = 2
_MOST_PACKED: Final = 255
"""Bytes that LZ4 makes of one, at most: a message may claim any size."""


class Span(NamedTuple):
    """Frames from the first to the last one, both included."""

    first: float = -inf
    last: float = inf

    def holds(self, frame: int) -> bool:
        """Whether a frame is one of them."""
        return self.first <= frame <= self.last

    def holds_all(self, frames: Collection[int]) -> bool:
        """Whether all frames are some of them."""
        return not frames or (self.holds(min(frames)) and self.holds(max(frames)))


ALWAYS: Final = Span()
"""That of what was logged once, for every frame."""


class Place(NamedTuple):
    """Where a message lies in the file, without its header, in bytes; and its frames."""

    path: str
    """Of its entity."""
    offset: int
    size: int
    span: Span | None = ALWAYS
    """None of rows without frames, which are not this program's: a log's, or a user's."""


class RrdFile:
    """An ``.rrd`` file by this program.

    A `RecordingError` if there is none, or it is not a recording by this program.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.below = ""
        """The path below which all entities are looked for."""
        self._places = defaultdict[str, list[Place]](list)
        self._kept: dict[str, tuple[Span, dict[int, pa.ListScalar]]] = {}
        """Of each entity the images of the message that was read last, by frame."""
        places, self.indexed = _read_places(path)
        spans = [(place.span.first, place.offset, place) for place in places if place.span]
        if len(spans) < len(places) and all(first == -inf for first, *_ in spans):
            raise RecordingError(
                f"{path}: its timeline {FRAME} was dropped; give the recording as it was made"
            )
        for _, _, place in sorted(spans, key=lambda span: span[:2]):
            self._places[place.path].append(place)

    def span(self, path: str) -> Span:
        """Return from which frame to which an entity has rows, but for what was logged once."""
        places = self._places.get(self.below + path, ())
        spans = [place.span for place in places if place.span and place.span != ALWAYS]
        firsts, lasts = zip(*spans, strict=True) if spans else ([inf], [-inf])
        return Span(min(firsts), max(lasts))

    def batches(self, path: str, component: str, *, static: bool) -> Iterator[pa.RecordBatch]:
        """Yield the rows of an entity that have a value, a batch a message.

        A `DamagedError` if they cannot be read.
        """
        places = self._places.get(self.below + path, ())
        return self._at(component, [p for p in places if (p.span == ALWAYS) == static])

    def image(self, path: str, component: str, frame: int) -> bytes | None:
        """Return the encoded image of an entity on a frame; None if there is none.

        A `DamagedError` if it cannot be read.
        """
        kept = self._kept.get(path)
        if kept is None or not kept[0].holds(frame):
            places = self._places.get(self.below + path, ())
            spans = {p: p.span for p in places if p.span and p.span != ALWAYS}
            here = {place: span for place, span in spans.items() if span.holds(frame)}
            if not here:
                return None
            firsts, lasts = zip(*here.values(), strict=True)
            images: dict[int, pa.ListScalar] = {}
            for batch in self._at(component, here):
                frames = batch.column(FRAME).to_pylist()
                images |= zip(frames, flat(batch.column(component)), strict=True)
            kept = self._kept[path] = Span(max(firsts), min(lasts)), images
        blob = kept[1].get(frame)
        return None if blob is None else bytes(np.from_dlpack(blob.values))

    def _at(self, component: str, places: Iterable[Place]) -> Iterator[pa.RecordBatch]:
        for place in places:
            with whole(self.path, place.path):
                with self.path.open("rb") as file:
                    if place.offset + place.size > file.seek(0, 2):
                        raise DamagedError(self.path, place.path)
                    file.seek(place.offset)
                    path, batch = rows_of(file.read(place.size))
                if path != place.path:
                    raise DamagedError(self.path, place.path)
                found = _filled(batch, component) if component in batch.schema.names else ()
            if len(found):
                yield found

    def rows(self, path: str, component: str) -> Iterator[tuple[int, Any]]:
        """Yield the frame and the value of each row."""
        for batch in self.batches(path, component, static=False):
            with whole(self.path, path):
                values = flat(batch.column(component)).to_pylist()
                rows = list(zip(batch.column(FRAME).to_pylist(), values, strict=True))
            yield from rows

    def document(self, path: str) -> str | None:
        """Return the document that was logged once; None if the run ended before it."""
        value = self.static(path, TEXT)
        return None if value is None else str(value)

    def static(self, path: str, component: str) -> Any:
        """Return the value that was logged once; None if there is none."""
        for batch in self.batches(path, component, static=True):
            with whole(self.path, path):
                return flat(batch.column(component))[0].as_py()
        return None


@contextmanager
def whole(path: Path, part: str) -> Iterator[None]:
    """Turn any exception while a part of a file is unpacked into a `DamagedError`.

    Arrow, JSON and the decoders of images each have exceptions of their own.
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


def rows_of(message: bytes) -> tuple[str, pa.RecordBatch]:
    """Return the entity's path and the rows of a message; an error of any kind if it is damaged."""
    own = dict(protobuf_fields(memoryview(message)))
    batch = _unpacked(own[_CONTENT], own.get(_COMPRESSION), own[_SIZE])
    return batch.schema.metadata[b"rerun:entity_path"].decode(), batch


def _unpacked(content: memoryview, compression: int | None, size: int) -> pa.RecordBatch:
    import lz4.block

    if compression == _LZ4:
        if size > _MOST_PACKED * len(content):
            raise ValueError("a size that cannot be")
        content = lz4.block.decompress(content, uncompressed_size=size)
    batch = pa.ipc.open_stream(content).read_next_batch()
    batch.validate(full=True)  # what does not add up would be read beyond its end
    return batch


def _filled(batch: pa.RecordBatch, component: str) -> pa.RecordBatch:
    """Return the rows with a value: one without says that from there on nothing is shown."""
    values = batch.column(component)
    if not values.null_count and np.diff(np.from_dlpack(values.offsets)).all():
        return batch
    import pyarrow.compute as pc

    lengths = pc.fill_null(pc.list_value_length(values), 0)
    return batch.filter(pc.greater(lengths, 0))


def _read_places(path: Path) -> tuple[list[Place], bool]:
    """Return where the messages of a recording lie, and whether its index says so.

    Without an index, as of a killed run, each whole message is read.
    """
    try:
        check_input(path)
        with path.open("rb") as file, whole(path, "its index"):
            if file.read(len(_MAGIC)) != _MAGIC:
                raise RecordingError(
                    f"{path}: not a recording (.rrd); 'roadeval replay' makes one of a log"
                )
            stores = _indexed(file)
            indexed = stores is not None
            found = _written(file) if stores is None else stores
            recordings, made_by = defaultdict[bytes, list[Place]](list), "an unknown program"
            for store, own in found:
                kind, application = _about(store)
                if kind == _RECORDING and application == APPLICATION:
                    recordings[bytes(store)] += own
                elif kind == _RECORDING:
                    made_by = application
    except FileNotFoundError as error:
        raise RecordingError(f"{path}: no such recording") from error
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from error
    if not recordings:
        raise RecordingError(f"{path}: a recording by {made_by}, not by {APPLICATION}")
    layouts = {
        store: Counter(place.path for place in places if place.path.endswith(LAYOUT))
        for store, places in recordings.items()
    }
    runs = [store for store, paths in layouts.items() if paths]
    held = sum(max(layouts[store].values()) for store in runs)
    if held > 1:
        raise RecordingError(
            f"{path}: holds {held} recordings, or parts of one, as `rerun rrd merge` joins them; "
            "give them one by one"
        )
    return recordings[(runs or [*recordings])[0]], indexed


def _about(store: memoryview) -> tuple[int, str]:
    """Return the kind of a store, and the program that made it."""
    fields = dict(protobuf_fields(store))
    return fields[1], bytes(dict(protobuf_fields(fields[3]))[1]).decode()


Stores = Iterable[tuple[memoryview, list[Place]]]
"""Descriptions of recordings and blueprints, and the places of messages of each."""


def _indexed(file: IO[bytes]) -> Stores | None:
    """Return what the index lists; None of a file without one."""
    end = file.seek(0, 2)
    file.seek(max(end - _END.size, 0))
    offset, length, _, magic, _ = _END.unpack(file.read(_END.size).rjust(_END.size))
    if magic != _END_MAGIC:
        return None
    file.seek(offset)
    index = memoryview(file.read(min(length, end)))
    parts = [dict(protobuf_fields(part)) for _, part in protobuf_fields(index)]
    return [(part[_STORE], _listed(part[_INDEX])) for part in parts]


def _listed(index: memoryview) -> list[Place]:
    own = dict(protobuf_fields(index))
    content, compression, size = (own[number] for number in (2, 3, 4))
    batch = _unpacked(content, compression, size)
    names = [f"chunk_{name}" for name in ("entity_path", "byte_offset", "byte_size", "is_static")]
    names += [name for name in (f"{FRAME}:start", f"{FRAME}:end") if name in batch.schema.names]
    columns = (batch.column(name).to_pylist() for name in names)
    return [
        Place(path, offset, size, ALWAYS if static else _span(frames))
        for path, offset, size, static, *frames in zip(*columns, strict=True)
    ]


def _span(frames: Sequence[int | None]) -> Span | None:
    """Return the frames between two; None without any."""
    numbers = [frame for frame in frames if frame is not None]
    return Span(min(numbers), max(numbers)) if numbers else None


def _written(file: IO[bytes]) -> Iterator[tuple[memoryview, list[Place]]]:
    """Read the whole messages of a file without an index."""
    end, offset = file.seek(0, 2), _BEGIN + _HEADER.size
    while offset <= end:
        file.seek(offset - _HEADER.size)
        kind, size = _HEADER.unpack(file.read(_HEADER.size))
        if kind == _LAST or offset + size > end:
            return
        if kind == _ROWS:
            message = file.read(size)
            path, batch = rows_of(message)
            timed = any(
                (each.metadata or {}).get(b"rerun:kind") == b"index" for each in batch.schema
            )
            frames = batch.column(FRAME).to_pylist() if FRAME in batch.schema.names else ()
            span = _span(frames) if timed else ALWAYS
            store = dict(protobuf_fields(memoryview(message)))[_STORE]
            yield store, [Place(path, offset, size, span)]
        offset += size + _HEADER.size


def indexed_messages(path: Path) -> int:
    """Return how many messages a recording's own index lists; 0 if it has no index."""
    try:
        places, indexed = _read_places(path)
    except RecordingError:
        return 0
    return len(places) if indexed else 0
