"""Rerun out: frames become a recording that opens offline, in whatever state it was left."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import rerun as rr

from roadeval.data import FrameResult
from roadeval.recording import layout as at
from roadeval.recording.layout import Layout, RecordingError
from roadeval.recording.read.recording import indexed_chunks
from roadeval.recording.screen import blueprint
from roadeval.recording.screen import records as style
from roadeval.recording.write import tracks
from roadeval.recording.write.encoding import Encoded, Encoder
from roadeval.recording.write.tracks import IMAGES_AND_WORDS, NUMBERS, Key, Tracks
from roadeval.runtime import files as folders

UNWRITTEN: Final = 4 << 20
"""Bytes that may wait for Rerun's own thread to write them; it would let any number wait."""

LEAST_FREE: Final = 64 << 20
"""Bytes that must stay free on the disk beside what waits. Checked before each chunk but the last,
for which it is meant: the partial recording then ends whole, while Rerun, should a write fail, may
wait for it forever."""


class Recorder:
    """Writes one recording, under the name ``partial`` until `finish`.

    A context manager: left by an exception it closes the partial recording, which stays
    readable.

    Parameters
    ----------
    path
        Where the complete recording will stand. A file there is replaced by `finish` only.
    layout
        What will come.
    """

    def __init__(self, path: Path, layout: Layout) -> None:
        self.path = path
        self.partial = path.with_name(f"{path.stem}.partial.rrd")
        self._layout = layout
        self._encoder = Encoder(layout)
        self._rows, self._numbers = Tracks(IMAGES_AND_WORDS), Tracks(NUMBERS)
        self._begun = False
        self._chunks = self._unwritten = 0
        self._states: dict[str, str] = {}
        self._shown: set[str] = set()
        self._blank: Encoded | None = None
        self._stream: rr.RecordingStream | None = None

    def __enter__(self) -> Self:
        """Open the partial file.

        Raises
        ------
        RecordingError
            If it cannot be written.
        """
        self._make_room()
        # The same input gives the same recording: its identity is its layout's, and properties
        # of the run, which Rerun would add, stay out.
        identity = hashlib.blake2b(self._layout.to_json().encode(), digest_size=16).hexdigest()
        stream = rr.RecordingStream(at.APPLICATION, recording_id=identity, send_properties=False)
        stream.save(self.partial, default_blueprint=blueprint.arrange(self._layout))
        stream.send_recording_name(self._layout.drive)
        self._stream = stream
        self._static(style.records(self._layout, self._encoder.codecs))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is not None and self.partial.exists():
            error.add_note(f"the partial recording is {self.partial}")
        try:
            self._close()
        except RecordingError:
            # What went wrong first is what the user must hear.
            if error is None:
                raise

    def encode(self, result: FrameResult, lines: Mapping[str, str]) -> Encoded:
        """Encode a frame and its table lines; the heavy part of the work, in any thread."""
        return self._encoder(result, lines)

    def write(self, encoded: Encoded) -> None:
        """Append a frame. Frames come in order, from one thread.

        Raises
        ------
        RecordingError
            If the disk is full.
        """
        if not self._begun:
            self._begun = True
            self._static(style.timing(encoded.scalars))
        self._add_images(encoded)
        self._add_words(encoded)
        when = encoded.number, encoded.stamp_ns
        for path, number in encoded.scalars.items():
            self._numbers.add(path, tracks.scalars, *when, number)
        for path, numbers in encoded.counts.items():
            self._numbers.add(path, tracks.counts, *when, numbers)
        self._turn(self._rows)
        self._turn(self._numbers)

    def write_pictures(self, held: Iterable[Encoded]) -> None:
        """Append the pictures of frames whose numbers stand already, in order.

        They are cleared right after their frame, so that no later one seems to show them. Whoever
        is interrupted may call it again with those that are left.
        """
        for encoded in held:
            if self._blank is not None and self._blank.number != encoded.number:
                self._add_images(self._blank)
            self._add_images(encoded)
            number, stamp_ns = encoded.number + 1, encoded.stamp_ns + 1
            self._blank = replace(encoded, number=number, stamp_ns=stamp_ns, payloads={})
            self._turn(self._rows)
        if self._blank is not None:
            self._add_images(self._blank)
            self._blank = None

    def settle(self) -> None:
        """Write all that waits, once the last frame is written: its memory is needed for results.

        Raises
        ------
        RecordingError
            If it cannot be written.
        """
        for waiting in (self._rows, self._numbers):
            for key in list(waiting):
                self._send(waiting, key)
        self._flush()

    def finish(self, results: Mapping[str, str]) -> None:
        """Add the results, close the file and give it its name.

        Parameters
        ----------
        results
            Texts to keep under ``/results``, by name: ``summary`` (JSON) and ``windows`` (CSV
            with its header).

        Raises
        ------
        RecordingError
            If the file did not become what was written to it, as on a full disk.
        """
        self._static(style.results(self._layout, results))
        self._close()
        if indexed_chunks(self.partial) < self._chunks:
            raise self._incomplete()
        self.partial.replace(self.path)

    def check_room(self) -> None:
        """Raise a `RecordingError` if the disk is full, or as good as full."""
        disk = shutil.disk_usage(self.path.parent)
        # A place that is no disk, as /proc, has no room to tell of.
        if disk.total and disk.free < LEAST_FREE + self._rows.size:
            raise RecordingError(f"{self.path}: cannot be written: the disk is full")

    def _add_images(self, encoded: Encoded) -> None:
        when = encoded.number, encoded.stamp_ns
        for path, payload in encoded.payloads.items():
            columns = self._encoder.codecs[path].columns
            self._rows.add(path, columns, *when, payload)
        # The viewer goes on showing what it has; an image that this frame lacks must not stand.
        for path in sorted(self._shown - encoded.payloads.keys()):
            self._rows.add(path, self._encoder.codecs[path].columns, *when, tracks.NOTHING)
        self._shown = set(encoded.payloads)

    def _add_words(self, encoded: Encoded) -> None:
        when = encoded.number, encoded.stamp_ns
        for path, state in encoded.states.items():
            if self._states.get(path, "") != state:
                self._rows.add(path, tracks.states, *when, state)
                self._states[path] = state
        for note in encoded.notes:
            self._rows.add(at.NOTES, tracks.notes, *when, note)
        for name, lines in encoded.tables.items():
            self._rows.add(at.result_path(name), tracks.texts, *when, lines)

    def _static(self, records: Iterable[tuple[str, list[Any]]]) -> None:
        stream = self._open_stream()
        for path, archetypes in records:
            stream.log(path, *archetypes, static=True, strict=True)

    def _turn(self, waiting: Tracks) -> None:
        """End a frame: write the tracks that have waited long enough."""
        ended = waiting.turn()
        for key in ended:
            self.check_room()
            self._send(waiting, key)
        if ended:
            self._flush()

    def _send(self, waiting: Tracks, key: Key) -> None:
        track = waiting[key]
        self._open_stream().send_chunks(track.chunk())
        # Only now: of a run that is interrupted above, the end of the recording still sends it.
        del waiting[key]
        self._chunks += 1
        self._unwritten += track.size
        if self._unwritten >= UNWRITTEN:
            self._flush()

    def _open_stream(self) -> rr.RecordingStream:
        if self._stream is None:
            raise RuntimeError("a recorder is used inside its 'with' block")
        return self._stream

    def _make_room(self) -> None:
        try:
            if self.path.is_dir():
                raise RecordingError(f"{self.path}: is a folder; name a file in it, ending in .rrd")
            with folders.made(self.path.parent):
                self.check_room()
                self.partial.touch()
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be written: {error.strerror}") from error

    def _flush(self) -> None:
        self._unwritten = 0
        try:
            self._open_stream().flush()
        except RuntimeError as error:
            raise self._incomplete() from error

    def _close(self) -> None:
        if self._stream is None:
            return
        try:
            self.settle()
        finally:
            self._stream.disconnect()
            self._stream = None

    def _incomplete(self) -> RecordingError:
        return RecordingError(f"{self.partial}: cannot be written any further; is the disk full?")


class NullRecorder:
    """Does nothing, for a run without a recording."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Nothing is open."""

    def encode(self, result: FrameResult, position: int, lines: Mapping[str, str]) -> None:
        """Encode nothing."""

    def write(self, encoded: None) -> None:
        """Write nothing."""

    def settle(self) -> None:
        """Nothing waits."""

    def finish(self, results: Mapping[str, str]) -> None:
        """Keep nothing."""
