"""A recording's file, read by rows of its entities; a killed run's as far as it was written.

A Rerun file is a sequence of messages, each with a header; the index is the last one::

    RRF2  [header|message] [header|message] ...  [header|index] [where the index lies]

A message holds rows of one entity, and can be read without the others. No other module knows the
bytes of the format.

Rerun's public reader, `rerun.chunk.RrdReader`, gives the same rows of an undamaged file
(``tests/recording/test_rrd_file``). But it crashed on two of 320 files with a few bytes changed at
random, and stopped at the damage in nearly all others; here every undamaged frame is read, and the
damage is one line (``tests/recording/test_damage``). Reading a table takes half the CPU time here,
0.27 s instead of 0.55 s, because Rerun is not imported.
"""

from __future__ import annotations

import struct
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from math import inf
from operator import attrgetter
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
"""The kinds of the last message and of a message with rows."""
_END: Final = struct.Struct("<QQI8sI")
"""The end of a file: the index's place and length, a checksum, `_END_MAGIC` and a version."""
_END_MAGIC: Final = b"RRF2FOOT"
_STORE, _COMPRESSION, _SIZE, _CONTENT = 1, 2, 3, 5
"""Fields of a message: the recording or blueprint that it belongs to, the compression, the
uncompressed size, and the content."""
_INDEX: Final = 4
"""The field of a store's part of the index that lists its messages."""
_LISTED_CONTENT, _LISTED_COMPRESSION, _LISTED_SIZE = 2, 3, 4
"""Fields of this list: the content, the compression, and the uncompressed size."""
_RECORDING: Final = 1
"""The kind of a store that is a recording, not a blueprint."""
_LZ4: Final = 2
_MOST_PACKED: Final = 255
"""Greatest number of bytes that LZ4 can make of one: a damaged message may claim any size."""


class FrameSpan(NamedTuple):
    """The frames from the first to the last one, both included."""

    first: float = -inf
    last: float = inf

    def holds(self, frame: int) -> bool:
        """Return whether a frame is one of them."""
        return self.first <= frame <= self.last


ALWAYS: Final = FrameSpan()
"""The span of data that was logged once, for every frame."""


class StoredMessage(NamedTuple):
    """The place of a message in the file, without its header, in bytes, and its frames."""

    path: str
    """The path of its entity."""
    offset: int
    size: int
    span: FrameSpan | None = ALWAYS
    """None for rows without frames, which another program has written."""


class RrdFile:
    """An ``.rrd`` file by this program.

    A `RecordingError` if there is no such file, or another program has written it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.below = ""
        """The prefix of the paths of all entities."""
        self.messages = defaultdict[str, list[StoredMessage]](list)
        """The messages of each entity, by its path."""
        self._images: dict[str, tuple[FrameSpan, dict[int, pa.ListScalar]]] = {}
        """The images of the message that was read last, by frame, of each entity."""
        messages, self.indexed = _find_messages(path)
        framed = [message for message in messages if message.span]
        if len(framed) < len(messages) and all(message.span == ALWAYS for message in framed):
            remedy = "give the recording as it was made"
            raise RecordingError(f"its timeline {FRAME} was dropped", where=path, remedy=remedy)
        for message in sorted(framed, key=attrgetter("span.first", "offset")):
            self.messages[message.path].append(message)

    def _framed(self, path: str) -> dict[StoredMessage, FrameSpan]:
        """Return an entity's messages with frames, and these frames."""
        messages = self.messages.get(self.below + path, ())
        return {m: m.span for m in messages if m.span and m.span != ALWAYS}

    def span(self, path: str) -> FrameSpan:
        """Return the frames from the first row of an entity to the last one."""
        spans = self._framed(path).values()
        firsts, lasts = zip(*spans, strict=True) if spans else ([inf], [-inf])
        return FrameSpan(min(firsts), max(lasts))

    def batches(self, path: str, component: str, *, static: bool) -> Iterator[pa.RecordBatch]:
        """Yield the rows of an entity that have a value, a batch for each message.

        A `DamagedError` if they cannot be read.
        """
        messages = self.messages.get(self.below + path, ())
        return self._read(component, [m for m in messages if (m.span == ALWAYS) == static])

    def image(self, path: str, component: str, frame: int) -> bytes | None:
        """Return the encoded image of an entity on a frame; None if there is none.

        A `DamagedError` if it cannot be read.
        """
        span, images = self._images.get(path, (None, {}))
        if span is None or not span.holds(frame):
            messages = {m: span for m, span in self._framed(path).items() if span.holds(frame)}
            if not messages:
                return None
            firsts, lasts = zip(*messages.values(), strict=True)
            images = {}
            for batch in self._read(component, messages):
                frames = batch.column(FRAME).to_pylist()
                images |= zip(frames, flat(batch.column(component)), strict=True)
            self._images[path] = FrameSpan(max(firsts), min(lasts)), images
        blob = images.get(frame)
        return None if blob is None else bytes(np.from_dlpack(blob.values))

    def _read(self, component: str, messages: Iterable[StoredMessage]) -> Iterator[pa.RecordBatch]:
        """Yield the rows of messages that have a value of a component."""
        for message in messages:
            with name_damage(self.path, message.path):
                with self.path.open("rb") as file:
                    if message.offset + message.size > file.seek(0, 2):
                        raise DamagedError(self.path, message.path)
                    file.seek(message.offset)
                    path, batch = rows_of(file.read(message.size))
                if path != message.path:
                    raise DamagedError(self.path, message.path)
                rows = _with_value(batch, component) if component in batch.schema.names else ()
            if len(rows):
                yield rows

    def rows(self, path: str, component: str) -> Iterator[tuple[int, Any]]:
        """Yield the frame and the value of each row."""
        for batch in self.batches(path, component, static=False):
            with name_damage(self.path, path):
                values = flat(batch.column(component)).to_pylist()
                rows = list(zip(batch.column(FRAME).to_pylist(), values, strict=True))
            yield from rows

    def document(self, path: str) -> str | None:
        """Return a document that was logged once; None if the run ended before."""
        value = self.static(path, TEXT)
        return None if value is None else str(value)

    def static(self, path: str, component: str) -> Any:
        """Return a value that was logged once; None if there is none."""
        for batch in self.batches(path, component, static=True):
            with name_damage(self.path, path):
                return flat(batch.column(component))[0].as_py()
        return None


@contextmanager
def name_damage(path: Path, part: str) -> Iterator[None]:
    """Turn any exception while a part of a file is read into a `DamagedError`.

    Arrow, JSON and the image decoders raise exceptions of their own.
    """
    try:
        yield
    except (RoadevalError, MemoryError):
        raise
    except Exception as error:
        raise DamagedError(path, part) from error


def flat(lists: pa.ListArray) -> pa.Array:
    """Return the values of lists one after the other; no list is null."""
    # Arrow's own function imports all of its compute module.
    begin, end = (lists.offsets[place].as_py() for place in (0, -1))
    return lists.values.slice(begin, end - begin)


def rows_of(message: bytes) -> tuple[str, pa.RecordBatch]:
    """Return the entity's path and the rows of a message; any exception if it is damaged."""
    fields = dict(protobuf_fields(memoryview(message)))
    batch = _decompress(fields[_CONTENT], fields.get(_COMPRESSION), fields[_SIZE])
    return batch.schema.metadata[b"rerun:entity_path"].decode(), batch


def _decompress(content: memoryview, compression: int | None, size: int) -> pa.RecordBatch:
    import lz4.block

    if compression == _LZ4:
        if size > _MOST_PACKED * len(content):
            raise ValueError("a size that cannot be")
        content = lz4.block.decompress(content, uncompressed_size=size)
    batch = pa.ipc.open_stream(content).read_next_batch()
    batch.validate(full=True)  # otherwise a damaged length is read beyond the end
    return batch


def _with_value(batch: pa.RecordBatch, component: str) -> pa.RecordBatch:
    """Return the rows with a value. A row without one clears the entity from its frame on."""
    values = batch.column(component)
    if not values.null_count and np.diff(np.from_dlpack(values.offsets)).all():
        return batch
    import pyarrow.compute as pc

    lengths = pc.fill_null(pc.list_value_length(values), 0)
    return batch.filter(pc.greater(lengths, 0))


def _find_messages(path: Path) -> tuple[list[StoredMessage], bool]:
    """Return the messages of a recording, and whether its index lists them.

    Without an index, as after a killed run, every complete message is read.
    """
    try:
        check_input(path)
        with path.open("rb") as file, name_damage(path, "its index"):
            if file.read(len(_MAGIC)) != _MAGIC:
                remedy = "'roadeval replay' makes one of a log"
                raise RecordingError("not a recording (.rrd)", where=path, remedy=remedy)
            indexed_stores = _read_index(file)
            stores = _scan(file) if indexed_stores is None else indexed_stores
            recordings = defaultdict[bytes, list[StoredMessage]](list)
            made_by = "an unknown program"
            for store, messages in stores:
                fields = dict(protobuf_fields(store))
                application = bytes(dict(protobuf_fields(fields[3]))[1]).decode()
                if fields[1] == _RECORDING and application == APPLICATION:
                    recordings[bytes(store)] += messages
                elif fields[1] == _RECORDING:
                    made_by = application
    except FileNotFoundError as error:
        raise RecordingError("no such recording", where=path) from error
    except OSError as error:
        raise RecordingError(str(error.strerror), where=path) from error
    if not recordings:
        raise RecordingError(f"a recording by {made_by}, not by {APPLICATION}", where=path)
    layouts = {
        store: Counter(message.path for message in messages if message.path.endswith(LAYOUT))
        for store, messages in recordings.items()
    }
    runs = [store for store, paths in layouts.items() if paths]
    count = sum(max(layouts[store].values()) for store in runs)
    if count > 1:
        problem = f"holds {count} recordings, or parts of one, as `rerun rrd merge` joins them"
        raise RecordingError(problem, where=path, remedy="give them one by one")
    return recordings[(runs or [*recordings])[0]], indexed_stores is not None


Stores = Iterable[tuple[memoryview, list[StoredMessage]]]
"""Descriptions of recordings and blueprints, each with its messages."""


def _read_index(file: IO[bytes]) -> Stores | None:
    """Return the stores in the index; None for a file without an index."""
    end = file.seek(0, 2)
    file.seek(max(end - _END.size, 0))
    offset, length, _, magic, _ = _END.unpack(file.read(_END.size).rjust(_END.size))
    if magic != _END_MAGIC:
        return None
    file.seek(offset)
    index = memoryview(file.read(min(length, end)))
    chunk = [f"chunk_{name}" for name in ("entity_path", "byte_offset", "byte_size", "is_static")]
    stores = []
    for _, part in protobuf_fields(index):
        store = dict(protobuf_fields(part))
        listed = dict(protobuf_fields(store[_INDEX]))
        packed = (listed[field] for field in (_LISTED_CONTENT, _LISTED_COMPRESSION, _LISTED_SIZE))
        batch = _decompress(*packed)
        ends = [name for name in (f"{FRAME}:start", f"{FRAME}:end") if name in batch.schema.names]
        columns = (batch.column(name).to_pylist() for name in (*chunk, *ends))
        messages = [
            StoredMessage(path, offset, size, ALWAYS if static else _span(frames))
            for path, offset, size, static, *frames in zip(*columns, strict=True)
        ]
        stores.append((store[_STORE], messages))
    return stores


def _span(frames: Sequence[int | None]) -> FrameSpan | None:
    """Return the span of some frames; None without any."""
    numbers = [frame for frame in frames if frame is not None]
    return FrameSpan(min(numbers), max(numbers)) if numbers else None


def _scan(file: IO[bytes]) -> Iterator[tuple[memoryview, list[StoredMessage]]]:
    """Yield the complete messages of a file without an index, each with its store."""
    end, offset = file.seek(0, 2), _BEGIN + _HEADER.size
    while offset <= end:
        file.seek(offset - _HEADER.size)
        kind, size = _HEADER.unpack(file.read(_HEADER.size))
        if kind == _LAST or offset + size > end:
            return
        if kind == _ROWS:
            message = file.read(size)
            path, batch = rows_of(message)
            kinds = [(column.metadata or {}).get(b"rerun:kind") for column in batch.schema]
            frames = batch.column(FRAME).to_pylist() if FRAME in batch.schema.names else ()
            span = _span(frames) if b"index" in kinds else ALWAYS
            store = dict(protobuf_fields(memoryview(message)))[_STORE]
            yield store, [StoredMessage(path, offset, size, span)]
        offset += size + _HEADER.size


def indexed_messages(path: Path) -> int:
    """Return the number of messages in a recording's index; 0 if it has no index."""
    try:
        messages, indexed = _find_messages(path)
    except RecordingError:
        return 0
    return len(messages) if indexed else 0
