"""Writes a recording while frames arrive. It can be opened in whatever state a run leaves it."""

from __future__ import annotations

import atexit
import ctypes
import errno
import hashlib
import os
import shutil
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, Self

import rerun as rr

from roadeval.data import FrameResult, LayerKind
from roadeval.recording import layout as at
from roadeval.recording.codecs import codecs_of
from roadeval.recording.layout import Layout, RecordingError, RecordRule, RuleKind
from roadeval.recording.read.rrd_file import MessageSums, indexed_chunks
from roadeval.recording.screen import blueprint, static
from roadeval.recording.write import rows as columns
from roadeval.recording.write.encoding import EncodedFrame, encode_frame, worst_error
from roadeval.recording.write.rows import IMAGES_AND_TEXT, NOTHING, NUMBERS, Batcher, Key
from roadeval.recording.write.worst import WorstFrames
from roadeval.runtime.files import NewFile

ALL: Final = RecordRule()
UNWRITTEN: Final = 4 << 20
"""Bytes that may wait for Rerun's own thread to write them, which has no limit itself."""

LEAST_FREE: Final = 64 << 20
"""Bytes that must stay free on the disk beside what waits. Checked before each chunk but the last,
for which it is meant: the partial recording then ends whole."""

PATIENCE_S: Final = 10.0
PATIENCE: Final = 30
"""How often, and for how long each time, a slow disk is waited for."""


class Recorder:
    """Writes one recording, under the name ``partial`` at first.

    A context manager: after `finish` the recording takes its name at the end. Left by an exception
    it closes the partial recording, which stays readable.

    Parameters
    ----------
    path
        The name of the complete recording. A file of that name is replaced at the end only.
    layout
        What will come.
    rule
        Which images are kept, any but ``none``. Those of ``worst:K`` wait on disk until the end.
    """

    def __init__(self, path: Path, layout: Layout, rule: RecordRule = ALL) -> None:
        self.path = path
        self._file = NewFile(path, hidden=False)
        self.partial = self._file.partial
        self._layout = layout
        self._rule = rule
        self._codecs = codecs_of(layout)
        self._rows, self._numbers = Batcher(IMAGES_AND_TEXT), Batcher(NUMBERS)
        self._begun = self._finished = self._failed = False
        self._chunks = self._unwritten = 0
        self._states: dict[str, str] = {}
        self._sums = MessageSums(self.partial)
        self._shown: set[str] = set()
        self._blank: EncodedFrame | None = None
        self._stream: rr.RecordingStream | None = None
        images = self.partial.with_name(f"{self.partial.name}-images")
        self._worst = WorstFrames(images, rule.number)

    def __enter__(self) -> Self:
        """Open the partial file.

        Raises
        ------
        RecordingError
            If it cannot be written.
        """
        try:
            with self._explained():
                self._file.begin()
                self.check_disk_space()
                self.partial.touch()
            self._open()
        except BaseException:  # an interrupt, too; it holds no frame
            self._file.discard()
            raise
        return self

    def _open(self) -> None:
        # The same input gives the same bytes: the identity is that of the layout, and Rerun's own
        # properties of the run are left out.
        identity = hashlib.blake2b(self._layout.to_json().encode(), digest_size=16).hexdigest()
        stream = rr.RecordingStream(at.APPLICATION, recording_id=identity, send_properties=False)
        stream.save(self.partial, default_blueprint=blueprint.arrange(self._layout))
        stream.send_recording_name(self._layout.drive)
        self._stream = stream
        self._log_static(static.before_the_first_frame(self._layout, self._codecs))

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        try:
            self._close()
            if self._finished and error is None:
                with self._explained():
                    self._file.publish()
        except RecordingError as failed:
            if error is None:  # else the first error is the one to report
                error = failed
                raise
        finally:
            self._worst.clear()
            if error is not None and self.partial.exists():
                error.add_note(f"the partial recording is {self.partial}")

    def encode(self, result: FrameResult, position: int, lines: Mapping[str, str]) -> EncodedFrame:
        """Encode a frame; the heavy part of the work, in any thread.

        Parameters
        ----------
        result
            With its layers.
        position
            Among the frames read, from 0.
        lines
            The frame's lines of the tables in `Layout.tables`, by name.
        """
        kinds: Collection[LayerKind] = tuple(LayerKind)
        match self._rule.kind:
            case RuleKind.MASKS:
                kinds = (LayerKind.MASK, LayerKind.LABELS)
            case RuleKind.EVERY if position % self._rule.number:
                kinds = ()
            case RuleKind.WORST if worst_error(result) < self._worst.least:
                kinds = ()
        return encode_frame(result, lines, self._layout, self._codecs, kinds)

    def write(self, encoded: EncodedFrame) -> None:
        """Append a frame. Frames come in order, from one thread.

        Raises
        ------
        RecordingError
            If the disk is full.
        """
        if not self._begun:
            self._begun = True
            self._log_static(static.timing_lines(encoded.scalars))
        put_aside = encoded.payloads and self._rule.kind is RuleKind.WORST
        self._add_images(replace(encoded, payloads={}) if put_aside else encoded)
        self._add_texts(encoded)
        when = encoded.number, encoded.stamp_ns
        for path, number in encoded.scalars.items():
            self._numbers.add(path, columns.scalars, *when, number)
        for path, numbers in encoded.counts.items():
            self._numbers.add(path, columns.counts, *when, numbers)
        self._end_frame(self._rows)
        self._end_frame(self._numbers)
        if put_aside:
            self.check_disk_space()
            self._worst.offer(encoded)

    def _write_worst(self) -> None:
        """Append the images put aside, in order; their frames' numbers are written already.

        They are cleared right after their frame, so that no later frame shows them. After an
        interrupt it may be called again.
        """
        for encoded in self._worst.take():
            if self._blank is not None and self._blank.number != encoded.number:
                self._add_images(self._blank)
            self._add_images(encoded)
            number, stamp_ns = encoded.number + 1, encoded.stamp_ns + 1
            self._blank = replace(encoded, number=number, stamp_ns=stamp_ns, payloads={})
            self._end_frame(self._rows)
        if self._blank is not None:
            self._add_images(self._blank)
            self._blank = None

    def flush(self) -> None:
        """Write everything that waits, after the last frame, to free its memory.

        Raises
        ------
        RecordingError
            If it cannot be written.
        """
        self._write_worst()
        self._send_all()

    def _send_all(self) -> None:
        for batcher in (self._rows, self._numbers):
            for key in list(batcher):
                self._send(batcher, key)
        self._flush_stream()

    def finish(self, results: Mapping[str, str]) -> None:
        """Add the results and close the file, which takes its name when the context ends.

        Parameters
        ----------
        results
            Texts to keep under ``/results`` by name, as ``summary`` (JSON) and ``windows`` (CSV).

        Raises
        ------
        RecordingError
            If the file lacks what was written to it, as on a full disk.
        """
        self._log_static(static.after_the_last_frame(self._layout, results))
        self.flush()
        self._log_static([(at.SUMS, [rr.TextDocument(self._sums.document())])])
        self._flush_stream()
        self._log_static([(self._sums.mark(), [rr.TextDocument("")])])
        self._close()
        if indexed_chunks(self.partial) < self._chunks:
            raise self._incomplete() from _failure(errno.EIO)
        self._finished = True

    def check_disk_space(self) -> None:
        """Raise a `RecordingError` if the disk is full, or as good as full; by an ENOSPC."""
        if self._is_disk_full():
            raise RecordingError(
                f"{self.path}: cannot be written: the disk is full ({LEAST_FREE >> 20} MiB must "
                "stay free)"
            ) from _failure(errno.ENOSPC)

    def _is_disk_full(self) -> bool:
        disk = shutil.disk_usage(self.partial.parent)
        # A place that is no disk, as /proc, has no size.
        return bool(disk.total) and disk.free < LEAST_FREE + self._rows.size

    def _add_images(self, encoded: EncodedFrame) -> None:
        when = encoded.number, encoded.stamp_ns
        for path, payload in encoded.payloads.items():
            self._rows.add(path, self._codecs[path].columns, *when, payload)
        # The viewer goes on showing an image until another comes, so a missing one is cleared.
        for path in sorted(self._shown - encoded.payloads.keys()):
            self._rows.add(path, self._codecs[path].columns, *when, NOTHING)
        self._shown = set(encoded.payloads)

    def _add_texts(self, encoded: EncodedFrame) -> None:
        when = encoded.number, encoded.stamp_ns
        for path, state in encoded.states.items():
            if self._states.get(path, "") != state:
                self._rows.add(path, columns.states, *when, state)
                self._states[path] = state
        for note in encoded.notes:
            self._rows.add(at.NOTES, columns.notes, *when, note)
        for name, lines in encoded.tables.items():
            self._rows.add(at.result_path(name), columns.texts, *when, lines)

    def _log_static(self, data: Iterable[tuple[str, list[Any]]]) -> None:
        stream = self._open_stream()
        for path, archetypes in data:
            stream.log(path, *archetypes, static=True, strict=True)

    def _end_frame(self, batcher: Batcher) -> None:
        """Write the rows that have waited long enough."""
        due = batcher.end_frame()
        for key in due:
            self.check_disk_space()
            self._send(batcher, key)
        if due:
            self._flush_stream()

    def _send(self, batcher: Batcher, key: Key) -> None:
        rows = batcher[key]
        self._open_stream().send_chunks(rows.chunk())
        # Not before: if the run is interrupted above, the rows are still sent at the end.
        del batcher[key]
        self._chunks += 1
        self._unwritten += rows.size
        if self._unwritten >= UNWRITTEN:
            self._flush_stream()

    def _open_stream(self) -> rr.RecordingStream:
        if self._failed:
            raise self._incomplete()
        if self._stream is None:
            raise RuntimeError("a recorder is used inside its 'with' block")
        return self._stream

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be written: {error.strerror}") from error

    def _flush_stream(self) -> None:
        self._unwritten = 0
        stream = self._open_stream()
        for _ in range(PATIENCE):
            try:
                stream.flush(timeout_sec=PATIENCE_S)
                self._sums.read_on()
                return
            except OSError as error:
                raise self._incomplete() from error
            except RuntimeError as error:
                if "timed out" not in str(error) or self._is_disk_full():
                    break
        # Its thread has ended. Rerun may wait for that for ever, here and when the process ends.
        atexit.unregister(rr.rerun_shutdown)
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(stream))
        self._failed, self._stream = True, None
        raise self._incomplete() from _failure(errno.ENOSPC if self._is_disk_full() else errno.EIO)

    def _close(self) -> None:
        if self._stream is None:
            return
        try:
            with suppress(RecordingError):  # the disk may have no room for them
                self._write_worst()
            self._send_all()
        finally:
            if self._stream is not None:
                self._stream.disconnect()
                self._stream = None

    def _incomplete(self) -> RecordingError:
        return RecordingError(f"{self.partial}: cannot be written any further; is the disk full?")


def _failure(number: int) -> OSError:
    """Return the error that Rerun has met, or would meet, and does not report."""
    return OSError(number, os.strerror(number))


class NullRecorder:
    """A recorder of a run without a recording: it does nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: Any) -> None:
        """Close nothing."""

    def encode(self, result: FrameResult, position: int, lines: Mapping[str, str]) -> None:
        """Encode nothing."""

    def write(self, encoded: None) -> None:
        """Write nothing."""

    def flush(self) -> None:
        """Flush nothing."""

    def finish(self, results: Mapping[str, str]) -> None:
        """Keep nothing."""


def recorder_for(path: Path | None, layout: Layout, rule: RecordRule) -> Recorder | NullRecorder:
    """Return a recorder that keeps images by a rule; without a path one that does nothing."""
    return NullRecorder() if path is None else Recorder(path, layout, rule)
