"""The recorder: it writes a recording while frames arrive, which a viewer can open at any time."""

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

from roadeval.data import ERRORS, FINAL_STAGE, IGNORE, TRUTH, FrameResult, Health, LayerKind
from roadeval.data.arrays import IGNORED
from roadeval.data.words import percent, short_names
from roadeval.evaluation.metrics import SHORT, TESTED
from roadeval.geometry.ground import Plan
from roadeval.images.disturbing import Disturbance
from roadeval.recording import layout as at
from roadeval.recording import rows as columns
from roadeval.recording import views
from roadeval.recording.codecs import Codec, codecs_of
from roadeval.recording.layout import Layout, RecordingError, RecordRule
from roadeval.recording.rows import IMAGES_AND_TEXT, NOTHING, NUMBERS, Batcher, Key, When
from roadeval.recording.rrd_file import indexed_messages
from roadeval.runtime.files import NewFile, partial_name, remove, writing
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.threads import in_thread


class EncodedFrame(NamedTuple):
    """A frame ready to be written. Mappings are by entity path."""

    when: When
    camera: str
    """The prefix of its entities' paths, see `roadeval.recording.layout.prefixes`."""
    payloads: Mapping[str, bytes]
    numbers: Mapping[str, tuple[float, ...]]
    states: Mapping[str, str]
    """All states, empty where undefined."""
    notes: tuple[tuple[str, str], ...]
    """Sentences with their levels."""
    texts: Mapping[str, str]
    """Rates in words."""
    error: float
    """The value that ranks frames, see `worst_error`."""

    @property
    def size(self) -> int:
        """Size of its images in bytes."""
        return sum(map(len, self.payloads.values()))


class _Camera(NamedTuple):
    """A camera of the recording, perhaps its only one."""

    prefix: str
    """The beginning of its entities' paths."""
    layout: Layout
    codecs: Mapping[str, Codec]
    """Codecs by paths without the prefix."""
    plan: Plan | None
    """The ground seen from above, if known."""


def _encode_images(
    result: FrameResult, camera: _Camera, kinds: Collection[LayerKind]
) -> Iterator[tuple[str, bytes]]:
    """Yield the encoded images of a frame by entity path; layers only of these kinds."""
    frame, size = result.frame, (camera.layout.height, camera.layout.width)
    # The viewer treats images as a video, so their size must not change.
    is_odd = any(0 != a != b for a, b in zip(size, frame.image.shape[:2], strict=True))
    images = [*_layer_images(result, camera.plan, kinds)]
    if frame.media_type in ("image/jpeg", "image/png") and not is_odd:
        yield at.CAMERA, bytes(frame.payload)
    else:
        images.insert(0, (at.CAMERA, frame.image))
    for text, disturbed in result.disturbed.items():
        below = f"{at.DISTURBED}/{Disturbance.parse(text).name}"
        pictures = [(at.CAMERA, disturbed.frame.image), *_layer_images(disturbed, None, kinds)]
        images += [(below + path, image) for path, image in pictures]
    for path, image in images:
        if image is not None:
            codec = camera.codecs[path]
            yield path, codec.encode(codec.fitted(image) if is_odd else image)


def _layer_images(
    result: FrameResult, plan: Plan | None, kinds: Collection[LayerKind]
) -> Iterator[tuple[str, Any]]:
    """Yield truth, layers and errors by entity path, and images of the ground seen from above."""
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
    """Yield defined rates, counts, milliseconds and stages' facts by entity path."""
    for tally in result.tallies:
        mask = f"{tally.variant}/{tally.stage}"
        for rate, value in tally.rates.items():
            if rate in rates and not math.isnan(value):
                yield f"/metrics/{mask}/{rate}", (value,)
                if rate in SHORT:
                    yield f"{at.PERCENT}/{mask}/{rate}", (100 * value,)
        yield f"/counts/{mask}", (*tally.counts, tally.counts.n)
    for variant in result.variants:
        for stage in variant.stages:
            mask = f"{variant.variant}/{stage.stage}"
            yield f"/timing/{mask}", (stage.seconds * 1e3,)
            for name, value in stage.output.facts.items():
                yield f"/facts/{mask}/{name}", (value,)


def worst_error(result: FrameResult, layout: Layout) -> float:
    """Return the error rate of the focus's final mask; -1 for a frame not evaluated.

    Without truth it is the doubt in that mask.
    """
    names = [layout.focus] if layout.focus else [variant.name for variant in layout.variants]
    if not layout.has_truth:
        doubts = [doubt for doubt in result.doubts if doubt.variant in names]
        signs = [sign for doubt in doubts[:1] for sign in (doubt.entropy, doubt.disagreement)]
        return next((sign for sign in signs if not math.isnan(sign)), -1.0)
    finals = (t for t in result.tallies if t.stage == FINAL_STAGE and t.variant in names)
    return max((t.rates[TESTED] for t in finals), default=-1.0)


class WorstFrames:
    """Encoded images of the frames with the highest ERR: at most ``most`` frames, `HELD` bytes.

    They wait here until the last frame is encoded.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._bytes = 0
        self._heap: list[tuple[float, int, str, EncodedFrame]] = []
        """Frames with their images alone, each after its ERR, minus its number, and its camera; the
        least ERR first."""
        self.least = 0.0
        """The least ERR that is still among the worst; any thread may read it."""

    def offer(self, encoded: EncodedFrame) -> None:
        """Keep a frame's images if it is among the worst; among equal frames the earlier ones."""
        bare = encoded._replace(numbers={}, states={}, notes=(), texts={})
        heapq.heappush(self._heap, (encoded.error, -encoded.when[0], encoded.camera, bare))
        self._bytes += bare.size
        while len(self._heap) > self._most or self._bytes > HELD:
            self._bytes -= heapq.heappop(self._heap)[-1].size
            self.least = self._heap[0][0] if self._heap else 0.0

    def take(self) -> Iterator[EncodedFrame]:
        """Yield the frames in order, with their images alone, and forget them one by one.

        It can be called again after an interrupt.
        """
        self._heap.sort(key=itemgetter(1))
        while self._heap:
            yield self._heap[-1][-1]
            self._heap.pop()


ALL: Final = RecordRule()
Texts = Mapping[str, Mapping[str, str]]
"""Results by their names, by camera."""
NO_TEXTS: Final[Texts] = {}
NO_LINES: Final[Mapping[str, str]] = {}
UNWRITTEN: Final = 4 << 20
"""Greatest number of bytes that wait for Rerun's own thread to write them; Rerun itself has no
limit."""

LEAST_FREE: Final = 64 << 20
"""Bytes that must stay free on the disk beside the rows that wait. Each chunk is written only if
they are free, except the last, which may use them: so a partial recording ends complete."""

HELD: Final = 256 << 20
"""Greatest number of bytes of images of the worst frames that wait until the end."""
WORTH_SAYING: Final = 100_000_000
"""Size in bytes from which the expected size of a recording is announced."""

PATIENCE_S: Final = 30.0
"""Seconds to wait for a disk that writes nothing."""
LOOK_S: Final = 0.5
"""Seconds between two looks at the size of the file on a slow disk."""


class Recorder:
    """Writes one recording, under the name ``partial`` at first.

    It is a context manager: if `finish` was called, the recording takes its name when the block
    ends. After an exception the partial recording is closed and stays readable. ``path`` is the
    name of the complete recording: a file of that name is replaced at the end only. ``rule``, any
    but ``none``, chooses the images to keep; those of ``worst:K`` wait until the end. A rig has a
    layout for each camera, by its name.
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
        self._layouts = {camera.prefix: camera.layout for camera in self._cameras.values()}
        self._rule = rule
        self._columns = {
            camera.prefix + path: codec.columns
            for camera in self._cameras.values()
            for path, codec in camera.codecs.items()
        }
        header_time = next(iter(self._layouts.values())).header_time
        self._rows, self._numbers = (
            Batcher(limits, header_time) for limits in (IMAGES_AND_TEXT, NUMBERS)
        )
        self._finished = self._failed = self._forecast_made = False
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
            # Rerun 0.41 keeps two threads and the last data of a closed stream until the next
            # `init`. This `init` opens no stream, and is not waited for if another file is stuck.
            # Nothing frees the threads of a blueprint that was given to `save`.
            wait([in_thread(lambda: rr.init(at.APPLICATION, init_logging=False))], LOOK_S)
            self._stream = stream = rr.RecordingStream(
                at.APPLICATION, recording_id=identity, send_properties=False
            )
            blueprint = views.arrange(layouts)
            self._watch(lambda: stream.save(self.partial, default_blueprint=blueprint))
            first, *_ = layouts.values()
            stream.send_recording_name(first.drive)
            if "" not in layouts:
                self._log_static(views.before_a_rig(at.prefixes(self._cameras), first))
            names = short_names([*self._cameras])
            for name, camera in self._cameras.items():
                static = [*views.before_the_first_frame(camera.layout, camera.codecs, names[name])]
                if camera.prefix:  # the properties of a rig are logged above
                    static = [(path, data) for path, data in static if path != at.PROPERTIES]
                self._log_static(static, camera.prefix)
        except BaseException:  # also an interrupt; the file holds no frame yet
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
        """Encode a frame: the heavy part of the work, for any thread.

        ``position`` counts the frames read, from 0.
        """
        camera = self._cameras.get(result.frame.camera) or self._cameras[""]
        frame, health, error = result.frame, result.health, worst_error(result, camera.layout)
        kinds: Collection[LayerKind] = tuple(LayerKind)
        match self._rule.kind:
            case "masks":
                kinds = (LayerKind.MASK, LayerKind.LABELS)
            case "every" if position % self._rule.number:
                kinds = ()
            case "worst" if error < self._worst.least:
                kinds = ()
        states = {at.ROLE: result.role.value}
        states |= {f"/state/{v.name}": health.get(v.name, "") for v in camera.layout.variants}
        level = "WARN" if set(health.values()) - {Health.OK} else "INFO"
        images = _encode_images(result, camera, kinds) if kinds else ()
        numbers = _numbers(result, camera.layout.rates)
        finals = {(v.name, v.stages[-1]): v.name for v in camera.layout.variants}
        rates = {name: "not scored" for name in finals.values() if camera.layout.has_truth}
        for tally in result.tallies:
            if name := finals.get((tally.variant, tally.stage)):
                lines = (f"{rate} {percent(tally.rates[rate])} %" for rate in SHORT)
                rates[name] = "\n".join(lines)
        texts = {f"{at.FRAME_RATES}/{name}": f"This frame:\n{text}" for name, text in rates.items()}
        return EncodedFrame(
            (frame.number, frame.stamp_ns, frame.log_time_ns),
            camera.prefix,
            {camera.prefix + path: payload for path, payload in images},
            {camera.prefix + path: values for path, values in numbers},
            {camera.prefix + path: state for path, state in states.items()},
            tuple((note, level) for note in result.notes),
            {camera.prefix + path: text for path, text in texts.items()},
            error,
        )

    def write(self, encoded: EncodedFrame, lines: Mapping[str, str] = NO_LINES) -> None:
        """Append a frame, with its lines of the tables in `Layout.tables`, by name.

        Frames come in order, from one thread. A `RecordingError` if the disk is full.
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
        for path, text in encoded.texts.items():
            self._numbers[path, columns.texts].add(when, text)
        self._end_frame(self._rows)
        self._end_frame(self._numbers)
        if put_aside:
            self._worst.offer(encoded)

    def forecast(self, encoded: EncodedFrame, frames: int) -> str:
        """Return a sentence on the size of a recording of so many frames, from its first images.

        It is empty for any further frame, and if the recording is small and fits.
        """
        if self._forecast_made or not encoded.payloads:
            return ""
        self._forecast_made = True
        shown = {
            "worst": min(self._rule.number, frames),
            "every": math.ceil(frames / max(self._rule.number, 1)),
        }.get(self._rule.kind, frames)
        size, room = shown * encoded.size, self._room()
        if self._rule.kind == "worst" and size > HELD:
            memory = f"{HELD >> 20} MiB of memory, about {HELD // encoded.size}"
            fitting = "{output.record} worst:{} keeps those that fit in {}"
            return Sentence(fitting, self._rule.number, memory)
        sentence = f"the recording will take about {size / 1e6:.0f} MB"
        if size > room:
            problem = f"{sentence}, and only {(room + LEAST_FREE) / 1e6:.0f} MB are free"
            less = Sentence("{output.record} masks or worst:50 takes less")
            elsewhere = Sentence("{output.save} names a place on another disk")
            return Sentence("{}: {}, or {}", problem, less, elsewhere)
        return sentence if size > WORTH_SAYING else ""

    def _write_worst(self) -> None:
        """Append the images of the worst frames in order; the frames' numbers are written already.

        They are cleared right after their frame, so that no later frame shows them. It can be
        called again after an interrupt.
        """
        for encoded in self._worst.take():
            blank = self._blank.get(encoded.camera)
            if blank is not None and blank.when[0] != encoded.when[0]:
                self._add_images(blank)
            self._add_images(encoded)
            number, stamp_ns, log_time_ns = encoded.when
            after = number + 1, stamp_ns + 1, log_time_ns + 1
            self._blank[encoded.camera] = encoded._replace(when=after, payloads={})
            self._end_frame(self._rows)
        while self._blank:
            self._add_images(self._blank.popitem()[1])

    def flush(self) -> None:
        """Write everything that waits after the last frame, to free its memory.

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

        ``results`` are the texts to keep under ``/results`` by name, such as ``summary`` (JSON) and
        ``windows`` (CSV); ``by_camera`` has those of each camera of a rig. A `RecordingError` if
        the file is incomplete, as on a full disk.
        """
        for name, camera in self._cameras.items():
            texts = by_camera[name] if name else results
            self._log_static(views.after_the_last_frame(camera.layout, texts), camera.prefix)
        if by_camera:
            self._log_static(views.after_a_rig(results))
        self.flush()
        for camera in self._cameras.values():
            pictured = json.dumps(self._pictured[camera.prefix])
            self._log_static([(at.SHOWN, [rr.TextDocument(pictured)])], camera.prefix)
        self._close()
        if indexed_messages(self.partial) < self._chunks:
            raise self._incomplete()
        self._finished = True

    def check_disk_space(self) -> None:
        """Raise a `RecordingError`, caused by an ENOSPC, if the disk is full or nearly full."""
        if self._room() < self._rows.size:
            problem = f"cannot be written: the disk is full ({LEAST_FREE >> 20} MiB must stay free)"
            raise RecordingError(problem, where=self.path) from _failure(errno.ENOSPC)

    def _room(self) -> float:
        """Return the free bytes beside `LEAST_FREE`; infinity where no disk is, as in /proc."""
        disk = shutil.disk_usage(self.partial.parent)
        return disk.free - LEAST_FREE if disk.total else math.inf

    def _add_images(self, encoded: EncodedFrame) -> None:
        when, below = encoded.when, encoded.camera
        if below + at.CAMERA in encoded.payloads:
            self._pictured[below].append(when[:2])
        # The viewer shows an image until the next one comes, so missing ones are cleared.
        missing = sorted(self._shown.get(below, set()) - encoded.payloads.keys())
        for path, payload in {**encoded.payloads, **dict.fromkeys(missing, NOTHING)}.items():
            self._rows[path, self._columns[path]].add(when, payload)
        self._shown[below] = set(encoded.payloads)

    def _log_static(self, data: Iterable[tuple[str, list[Any]]], below: str = "") -> None:
        stream = self._open_stream()
        for path, archetypes in data:
            stream.log(below + path, *archetypes, static=True, strict=True)

    def _end_frame(self, batcher: Batcher) -> None:
        """Write the rows that are due."""
        due_keys = batcher.end_frame()
        for key in due_keys:
            self.check_disk_space()
            self._send(batcher, key)
        if due_keys:
            self._flush_stream()

    def _send(self, batcher: Batcher, key: Key) -> None:
        rows = batcher[key]
        self._open_stream().send_chunks(rows.chunk())
        # Only now: after an interrupt above, the rows are still sent at the end.
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
        """Make a call that waits for Rerun's writer; a `RecordingError` if the file cannot grow.

        Rerun would then wait forever, in such a call and when the process ends.
        """
        answer, size, looks = in_thread(call), -1, 0
        while not wait([answer], LOOK_S).done and not self._refusal():
            last_size, size = size, self._size()
            looks = looks + 1 if size == last_size else 0
            if looks * LOOK_S >= PATIENCE_S:
                break
        failure = answer.exception() if answer.done() else None
        if failure or not answer.done():
            atexit.unregister(rr.rerun_shutdown)
            in_thread(partial(_keep, self._stream))
            self._failed, self._stream = True, None
            raise self._incomplete(failure)

    def _size(self) -> int:
        return self.partial.stat().st_size if self.partial.exists() else 0

    def _refusal(self) -> OSError | None:
        """Return the error of writing one more byte, such as a full quota; None if it works."""
        if self._room() < self._rows.size:
            return _failure(errno.ENOSPC)
        with suppress(ImportError):  # only POSIX has such a limit
            import resource

            limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
            if limit != resource.RLIM_INFINITY and self._size() >= limit:
                return _failure(errno.EFBIG)
        probe = partial_name(self.partial)
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
            with suppress(RecordingError):  # the disk may have no room for the images
                self._write_worst()
            self._send_all()
        finally:
            if self._stream is not None:
                self._watch(self._stream.disconnect)
                self._stream = None

    def _incomplete(self, failure: BaseException | None = None) -> RecordingError:
        """Return the error of a file that cannot grow, or else of a call of Rerun that failed."""
        refusal = self._refusal() or (None if failure else _failure(errno.EIO))
        reason = refusal.strerror if refusal else " ".join(str(failure).split())
        error = RecordingError(f"cannot be written any further: {reason}", where=self.path)
        error.__cause__ = refusal or failure
        return error


def _keep(_stream: object) -> None:
    """Keep a stream as long as the process lives: freeing it would wait for its writer."""
    Event().wait()


def _failure(number: int) -> OSError:
    """Return the error of the system that Rerun does not report."""
    return OSError(number, os.strerror(number))
