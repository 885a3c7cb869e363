"""Writes a recording while frames arrive. It can be opened in any state that a run leaves."""

from __future__ import annotations

import atexit
import errno
import hashlib
import heapq
import json
import math
import os
import shutil
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from concurrent.futures import wait
from contextlib import suppress
from functools import partial
from operator import itemgetter
from pathlib import Path
from threading import Event
from typing import Any, Final, NamedTuple, Self

import rerun as rr

from roadeval.data import (
    BASELINE,
    ERRORS,
    FINAL_STAGE,
    IGNORE,
    TRUTH,
    FrameResult,
    Health,
    LayerKind,
)
from roadeval.data.arrays import IGNORED
from roadeval.data.words import short_names
from roadeval.evaluation.metrics import TESTED
from roadeval.geometry.plan import Plan
from roadeval.recording import layout as at
from roadeval.recording import rows as columns
from roadeval.recording import views
from roadeval.recording.codecs import Codec, codecs_of
from roadeval.recording.layout import Layout, RecordingError, RecordRule
from roadeval.recording.rows import IMAGES_AND_TEXT, NOTHING, NUMBERS, Batcher, Key, When
from roadeval.recording.rrd_file import indexed_messages
from roadeval.runtime.files import NewFile, own_name, remove, writing
from roadeval.runtime.threads import in_thread


class EncodedFrame(NamedTuple):
    """A frame ready to be written. Mappings are by entity path."""

    when: When
    camera: str
    """Below which path all its entities lie, see `roadeval.recording.layout.prefixes`."""
    payloads: Mapping[str, bytes]
    numbers: Mapping[str, tuple[float, ...]]
    states: Mapping[str, str]
    """Every state, empty if undefined."""
    notes: tuple[tuple[str, str], ...]
    """Sentences, each with its level."""
    error: float
    """By what frames are ranked, see `worst_error`."""

    @property
    def size(self) -> int:
        """Bytes of its images."""
        return sum(map(len, self.payloads.values()))


class _Camera(NamedTuple):
    """A camera of the recording, perhaps its only one."""

    prefix: str
    """Begins the paths of its entities."""
    layout: Layout
    codecs: Mapping[str, Codec]
    """By paths without the prefix."""
    plan: Plan | None
    """The ground as it is shown from above, where it is known."""


def _payloads(
    result: FrameResult, camera: _Camera, kinds: Collection[LayerKind]
) -> Iterator[tuple[str, bytes]]:
    """Yield the images of a frame by entity path; of its layers those of some kinds."""
    frame, size = result.frame, (camera.layout.height, camera.layout.width)
    # The viewer takes images for a video, whose size must not change.
    is_odd = any(0 != a != b for a, b in zip(size, frame.image.shape[:2], strict=True))
    pictures = [*_pictures(result, camera.plan, kinds)]
    if frame.media_type in ("image/jpeg", "image/png") and not is_odd:
        yield at.CAMERA, bytes(frame.payload)
    else:
        pictures.insert(0, (at.CAMERA, frame.image))
    for path, picture in pictures:
        if picture is not None:
            codec = camera.codecs[path]
            yield path, codec.encode(codec.fitted(picture) if is_odd else picture)


def _pictures(
    result: FrameResult, plan: Plan | None, kinds: Collection[LayerKind]
) -> Iterator[tuple[str, Any]]:
    """Yield the arrays beside the camera's image, as they are and as they look from above."""
    frame, errors = result.frame, {n: layer.array for n, layer in result.errors.items()}
    yield from ((at.TRUTH_PATH, frame.truth), (at.TRUE_SHADOW, frame.shadow_truth))
    for variant in result.variants:
        for layer in variant.layers():
            if layer.spec.kind in kinds:
                yield f"/{variant.variant}/{layer.spec.name}", layer.content
    for name, array in errors.items():
        yield f"/{name}/{ERRORS.name}", array
    if plan is not None and frame.image.shape[:2] == (plan.ground.height, plan.ground.width):
        yield at.GROUND, plan.picture(frame.image)
        if frame.truth is not None:
            yield f"/ground/{TRUTH.name}", plan.picture(frame.truth, IGNORE)
        for name, array in errors.items():
            yield f"/ground/{name}", plan.picture(array, IGNORED)


def _numbers(
    result: FrameResult, rates: Collection[str]
) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Yield rates that are defined, counts, milliseconds and facts by entity path."""
    for tally in result.tallies:
        mask = f"{tally.variant}/{tally.stage}"
        for rate, value in tally.rates.items():
            if rate in rates and not math.isnan(value):
                yield f"/metrics/{mask}/{rate}", (value,)
        yield f"/counts/{mask}", (*tally.counts, tally.counts.n)
    for variant in result.variants:
        for stage in variant.stages:
            mask = f"{variant.variant}/{stage.stage}"
            yield f"/timing/{mask}", (stage.seconds * 1e3,)
            for name, value in stage.output.facts.items():
                yield f"/facts/{mask}/{name}", (value,)


def worst_error(result: FrameResult, layout: Layout) -> float:
    """Return the greatest error rate of any variant's final mask; -1 for a frame not evaluated.

    Where no frame has truth it is how much the first variant's mask is in doubt.
    """
    if not layout.has_truth:
        signs = [(each.entropy, each.disagreement) for each in result.doubts[:1]]
        return next((sign for each in signs for sign in each if not math.isnan(sign)), -1.0)
    finals = (t for t in result.tallies if t.stage == FINAL_STAGE and t.variant != BASELINE)
    return max((t.rates[TESTED] for t in finals), default=-1.0)


class WorstFrames:
    """The images of the frames with the highest ERR, at most ``most`` and those that fit in `HELD`.

    They are held as they are written, until the last frame is known.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._bytes = 0
        self._heap: list[tuple[float, int, str, EncodedFrame]] = []
        """ERR, minus the number, and the camera of each frame, the least first; and the frame with
        its images alone."""
        self.least = 0.0
        """The least ERR that can still be among the worst; for any thread."""

    def offer(self, encoded: EncodedFrame) -> None:
        """Keep a frame's images if they are among the worst; of equals the earlier ones."""
        bare = encoded._replace(numbers={}, states={}, notes=())
        heapq.heappush(self._heap, (encoded.error, -encoded.when[0], encoded.camera, bare))
        self._bytes += bare.size
        while len(self._heap) > self._most or self._bytes > HELD:
            self._bytes -= heapq.heappop(self._heap)[-1].size
            self.least = self._heap[0][0] if self._heap else 0.0

    def take(self) -> Iterator[EncodedFrame]:
        """Yield the frames in order, with their images alone, and forget each.

        After an interrupt it can be called again.
        """
        self._heap.sort(key=itemgetter(1))
        while self._heap:
            yield self._heap[-1][-1]
            self._heap.pop()


ALL: Final = RecordRule()
Texts = Mapping[str, Mapping[str, str]]
"""Results by their name, of each camera by its name."""
NO_TEXTS: Final[Texts] = {}
NO_LINES: Final[Mapping[str, str]] = {}
UNWRITTEN: Final = 4 << 20
"""Bytes that may wait for Rerun's own thread to write them, which has no limit itself."""

LEAST_FREE: Final = 64 << 20
"""Bytes that must stay free on the disk beside what waits. Checked before each chunk but the last,
for which it is meant: the partial recording then ends whole."""

HELD: Final = 256 << 20
"""Bytes of images of the worst frames that are held until the end."""
WORTH_SAYING: Final = 100_000_000
"""Bytes of a recording whose expected size is said."""

PATIENCE_S: Final = 30.0
"""How long a disk is waited for that takes nothing."""
LOOK_S: Final = 0.5
"""Between two looks at what a slow disk has taken."""


class Recorder:
    """Writes one recording, under the name ``partial`` at first.

    A context manager: after `finish` the recording takes its name at the end. Left by an exception
    it closes the partial recording, which stays readable. ``path`` is the name of the complete
    recording: a file of that name is replaced at the end only. ``rule`` says which images are kept,
    any but ``none``; those of ``worst:K`` wait until the end. Of a rig there is a layout for each
    camera, by its name.
    """

    def __init__(
        self, path: Path, layout: Layout | Mapping[str, Layout], rule: RecordRule = ALL
    ) -> None:
        self.path = path
        self._file = NewFile(path, hidden=False)
        self.partial = self._file.partial
        layouts = {"": layout} if isinstance(layout, Layout) else dict(layout)
        self._cameras = {
            name: _Camera(prefix, layouts[name], codecs_of(layouts[name]), layouts[name].plan())
            for name, prefix in at.prefixes(layouts).items()
        }
        self._layouts = {each.prefix: each.layout for each in self._cameras.values()}
        self._rule = rule
        self._columns = {
            each.prefix + path: codec.columns
            for each in self._cameras.values()
            for path, codec in each.codecs.items()
        }
        header_time = next(iter(self._layouts.values())).header_time
        self._rows, self._numbers = (
            Batcher(limits, header_time) for limits in (IMAGES_AND_TEXT, NUMBERS)
        )
        self._finished = self._failed = self._foretold = False
        self._chunks = self._unwritten = 0
        self._states: dict[str, str] = {}
        self._shown: dict[str, set[str]] = {}
        self._pictured = defaultdict[str, list[tuple[int, ...]]](list)
        self._blank: dict[str, EncodedFrame] = {}
        self._stream: rr.RecordingStream | None = None
        self._worst = WorstFrames(rule.number)

    def __enter__(self) -> Self:
        """Open the partial file; a `RecordingError` if it cannot be written."""
        try:
            with writing(self.path, RecordingError):
                self._file.begin()
                self.check_disk_space()
                self.partial.touch()
            layouts = self._layouts
            texts = "".join(prefix + layout.to_json() for prefix, layout in layouts.items())
            identity = hashlib.blake2b(texts.encode(), digest_size=16).hexdigest()
            # Rerun 0.41 keeps two threads and the last data of a closed stream until its next
            # `init`, which opens none here, and is not waited for if another file is stuck. No call
            # frees those of a blueprint that was given to `save`.
            wait([in_thread(lambda: rr.init(at.APPLICATION, init_logging=False))], LOOK_S)
            self._stream = stream = rr.RecordingStream(
                at.APPLICATION, recording_id=identity, send_properties=False
            )
            blueprint = views.arrange(layouts)
            self._watch(lambda: stream.save(self.partial, default_blueprint=blueprint))
            first, *_ = layouts.values()
            stream.send_recording_name(first.drive)
            if "" not in layouts:
                self._log_static(views.of_a_rig(at.prefixes(self._cameras), first))
            names = short_names([*self._cameras])
            for name, each in self._cameras.items():
                static = views.before_the_first_frame(each.layout, each.codecs, names[name])
                kept = ((p, a) for p, a in static if not each.prefix or p != at.PROPERTIES)
                self._log_static(kept, each.prefix)
        except BaseException:  # an interrupt, too; it holds no frame
            self._file.discard()
            raise
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        try:
            self._close()
            if self._finished and error is None:
                with writing(self.path, RecordingError):
                    self._file.publish()
        except RecordingError as failed:
            if error is None:  # else the first error is the one to report
                error = failed
                raise
        finally:
            if error is not None and self.partial.exists():
                error.add_note(f"the partial recording is {self.partial}")

    def encode(self, result: FrameResult, position: int) -> EncodedFrame:
        """Encode a frame; the heavy part of the work, in any thread.

        ``position`` counts the frames read, from 0.
        """
        own = self._cameras.get(result.frame.camera) or self._cameras[""]
        frame, health, error = result.frame, result.health, worst_error(result, own.layout)
        kinds: Collection[LayerKind] = tuple(LayerKind)
        match self._rule.kind:
            case "masks":
                kinds = (LayerKind.MASK, LayerKind.LABELS)
            case "every" if position % self._rule.number:
                kinds = ()
            case "worst" if error < self._worst.least:
                kinds = ()
        states = {at.ROLE: result.role.value}
        states |= {f"/state/{v.name}": health.get(v.name, "") for v in own.layout.variants}
        level = "WARN" if set(health.values()) - {Health.OK} else "INFO"
        payloads, numbers = _payloads(result, own, kinds), _numbers(result, own.layout.rates)
        return EncodedFrame(
            (frame.number, frame.stamp_ns, frame.log_time_ns),
            own.prefix,
            {own.prefix + path: each for path, each in payloads} if kinds else {},
            {own.prefix + path: each for path, each in numbers},
            {own.prefix + path: each for path, each in states.items()},
            tuple((note, level) for note in result.notes),
            error,
        )

    def write(self, encoded: EncodedFrame, lines: Mapping[str, str] = NO_LINES) -> None:
        """Append a frame, with its lines of the tables in `Layout.tables`, by name.

        Frames come in order, from one thread.

        A `RecordingError` if the disk is full.
        """
        when, below = encoded.when, encoded.camera
        if below not in self._shown:
            paths = (path.removeprefix(below) for path in encoded.numbers)
            self._log_static(views.timing_lines(paths), below)
        put_aside = encoded.payloads and self._rule.kind == "worst"
        self._add_images(encoded._replace(payloads={}) if put_aside else encoded)
        for path, state in encoded.states.items():
            if self._states.get(path, "") != state:
                self._rows[path, columns.states].add(when, state)
                self._states[path] = state
        for note in encoded.notes:
            self._rows[below + at.NOTES, columns.notes].add(when, note)
        for name, text in lines.items():
            self._rows[below + f"/results/{name}", columns.texts].add(when, text)
        for path, numbers in encoded.numbers.items():
            self._numbers[path, columns.numbers].add(when, numbers)
        self._end_frame(self._rows)
        self._end_frame(self._numbers)
        if put_aside:
            self._worst.offer(encoded)

    def forecast(self, encoded: EncodedFrame, frames: int) -> str:
        """Return how large the recording of so many frames becomes, by its first with images.

        Empty for any further one, and where it is small and fits.
        """
        if self._foretold or not encoded.payloads:
            return ""
        self._foretold = True
        shown = {
            "worst": min(self._rule.number, frames),
            "every": math.ceil(frames / max(self._rule.number, 1)),
        }.get(self._rule.kind, frames)
        size, room = shown * encoded.size, self._room()
        if self._rule.kind == "worst" and size > HELD:
            kept = f"{HELD >> 20} MiB of memory, about {HELD // encoded.size}"
            return f"`output.record` worst:{self._rule.number} keeps those that fit in {kept}"
        said = f"the recording will take about {size / 1e6:.0f} MB"
        if size > room:
            free = f"{(room + LEAST_FREE) / 1e6:.0f} MB are free"
            return (
                f"{said}, and only {free}: `output.record` masks or worst:50 takes less, or "
                "`output.save` names a place on another disk"
            )
        return said if size > WORTH_SAYING else ""

    def _write_worst(self) -> None:
        """Append the images put aside, in order; their frames' numbers are written already.

        They are cleared right after their frame, so that no later frame shows them. After an
        interrupt it may be called again.
        """
        for encoded in self._worst.take():
            before = self._blank.get(encoded.camera)
            if before is not None and before.when[0] != encoded.when[0]:
                self._add_images(before)
            self._add_images(encoded)
            number, stamp_ns, log_time_ns = encoded.when
            after = number + 1, stamp_ns + 1, log_time_ns + 1
            self._blank[encoded.camera] = encoded._replace(when=after, payloads={})
            self._end_frame(self._rows)
        while self._blank:
            self._add_images(self._blank.popitem()[1])

    def flush(self) -> None:
        """Write everything that waits, after the last frame, to free its memory.

        A `RecordingError` if it cannot be written.
        """
        self._write_worst()
        self._send_all()

    def _send_all(self) -> None:
        for batcher in (self._rows, self._numbers):
            for key in list(batcher):
                self._send(batcher, key)
        self._flush_stream()

    def finish(self, results: Mapping[str, str], *, by_camera: Texts = NO_TEXTS) -> None:
        """Add the results and close the file, which takes its name when the context ends.

        ``results`` are the texts to keep under ``/results`` by name, as ``summary`` (JSON) and
        ``windows`` (CSV); of a rig there are those of each camera, too, by its name. A
        `RecordingError` if the file lacks what was written to it, as on a full disk.
        """
        for name, each in self._cameras.items():
            texts = by_camera[name] if name else results
            self._log_static(views.after_the_last_frame(each.layout, texts), each.prefix)
        if by_camera:
            self._log_static(views.after_a_rig(results))
        self.flush()
        for each in self._cameras.values():
            pictured = json.dumps(self._pictured[each.prefix])
            self._log_static([(at.SHOWN, [rr.TextDocument(pictured)])], each.prefix)
        self._close()
        if indexed_messages(self.partial) < self._chunks:
            raise self._incomplete()
        self._finished = True

    def check_disk_space(self) -> None:
        """Raise a `RecordingError` if the disk is full, or as good as full; by an ENOSPC."""
        if self._room() < self._rows.size:
            raise RecordingError(
                f"{self.path}: cannot be written: the disk is full ({LEAST_FREE >> 20} MiB must "
                "stay free)"
            ) from _failure(errno.ENOSPC)

    def _room(self) -> float:
        """Return the bytes beside `LEAST_FREE`; a place that is no disk, as /proc, has no end."""
        disk = shutil.disk_usage(self.partial.parent)
        return disk.free - LEAST_FREE if disk.total else math.inf

    def _add_images(self, encoded: EncodedFrame) -> None:
        when, below = encoded.when, encoded.camera
        if below + at.CAMERA in encoded.payloads:
            self._pictured[below].append(when[:2])
        # The viewer goes on showing an image until another comes, so a missing one is cleared.
        missing = sorted(self._shown.get(below, set()) - encoded.payloads.keys())
        for path, payload in {**encoded.payloads, **dict.fromkeys(missing, NOTHING)}.items():
            self._rows[path, self._columns[path]].add(when, payload)
        self._shown[below] = set(encoded.payloads)

    def _log_static(self, data: Iterable[tuple[str, list[Any]]], below: str = "") -> None:
        stream = self._open_stream()
        for path, archetypes in data:
            stream.log(below + path, *archetypes, static=True, strict=True)

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

    def _flush_stream(self) -> None:
        self._unwritten = 0
        self._watch(self._open_stream().flush)

    def _watch(self, call: Callable[[], object]) -> None:
        """Make a call that waits for Rerun's writer, which ends where the file cannot grow.

        Rerun waits for it without end then, in such a call and when the process ends.
        """
        answer, size, looks = in_thread(call), -1, 0
        while not wait([answer], LOOK_S).done and not self._refusal():
            before, size = size, self._size()
            looks = looks + 1 if size == before else 0
            if looks * LOOK_S >= PATIENCE_S:
                break
        if not answer.done() or answer.exception():
            atexit.unregister(rr.rerun_shutdown)
            in_thread(partial(_keep, self._stream))
            self._failed, self._stream = True, None
            raise self._incomplete()

    def _size(self) -> int:
        return self.partial.stat().st_size if self.partial.exists() else 0

    def _refusal(self) -> OSError | None:
        """Return the error with which one more byte is refused, as at a limit or a full quota."""
        if self._room() < self._rows.size:
            return _failure(errno.ENOSPC)
        with suppress(ImportError):  # elsewhere than on POSIX there is no such limit
            import resource

            limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
            if limit != resource.RLIM_INFINITY and self._size() >= limit:
                return _failure(errno.EFBIG)
        probe = own_name(self.partial)
        try:
            probe.write_bytes(b"\0")
        except OSError as error:
            return error
        finally:
            remove(probe)
        return None

    def _close(self) -> None:
        if self._stream is None:
            return
        try:
            with suppress(RecordingError):  # the disk may have no room for them
                self._write_worst()
            self._send_all()
        finally:
            if self._stream is not None:
                self._watch(self._stream.disconnect)
                self._stream = None

    def _incomplete(self) -> RecordingError:
        refusal = self._refusal() or _failure(errno.EIO)
        error = RecordingError(f"{self.path}: cannot be written any further: {refusal.strerror}")
        error.__cause__ = refusal
        return error


def _keep(_stream: object) -> None:
    """Keep a stream as long as the process lives: whoever frees it waits for its writer."""
    Event().wait()


def _failure(number: int) -> OSError:
    """Return the error that Rerun has met, or would meet, and does not report."""
    return OSError(number, os.strerror(number))


class NullRecorder:
    """A recorder of a run without a recording: it does nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: Any) -> None:
        """Close nothing."""

    def encode(self, result: FrameResult, position: int) -> None:
        """Encode nothing."""

    def forecast(self, _encoded: None, _frames: int) -> str:
        """Return nothing to say."""
        return ""

    def write(self, encoded: None, lines: Mapping[str, str] = NO_LINES) -> None:
        """Write nothing."""

    def flush(self) -> None:
        """Flush nothing."""

    def finish(self, results: Mapping[str, str], *, by_camera: Texts = NO_TEXTS) -> None:
        """Keep nothing."""


def recorder_for(
    path: Path | None, layout: Layout | Mapping[str, Layout], rule: RecordRule
) -> Recorder | NullRecorder:
    """Return a recorder that keeps images by a rule; without a path one that does nothing."""
    return NullRecorder() if path is None else Recorder(path, layout, rule)
