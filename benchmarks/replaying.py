"""`replay` against the codec floor: the same frames, threads, codecs and recorder."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import cv2
import lz4.block
import numpy as np

import roadeval
from benchmarks.timing import Cost, Meter
from roadeval.config.run import RunConfig
from roadeval.data import FrameResult, Packed
from roadeval.jobs.progress import ignore
from roadeval.jobs.run import summary
from roadeval.jobs.run.prepared import prepare, process
from roadeval.logs.frames import LoggedFrame
from roadeval.logs.log import open_log
from roadeval.recording import codecs
from roadeval.recording.layout import RecordRule
from roadeval.recording.recorder import Recorder
from roadeval.results.folder import ResultsWriter
from roadeval.results.rows import Key, csv_lines, frame_rows, sum_rows
from roadeval.runtime.threads import map_ordered

ALL: Final = RecordRule.parse("all")
NOISY: Final = (
    *(cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_PAETH),
    *(cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE),
)
HELD_BYTES: Final = 400 << 20
"""Bytes of the layers that are computed beforehand and held for the floor, which repeats them."""


@dataclass(frozen=True)
class Held:
    """The work of the floor: files to decode, and finished frames to encode and write."""

    files: list[tuple[bytes, ...]]
    results: list[FrameResult]
    layout: Any
    layer_bytes: float
    """Encoded bytes of a frame without the camera's own file and the truths."""

    def frames(self) -> Iterator[tuple[int, tuple[bytes, ...], FrameResult]]:
        """Yield every frame's number and files, with one of the held results."""
        for number, files in enumerate(self.files):
            result = self.results[number % len(self.results)]
            frame = replace(result.frame, number=number, stamp_ns=(number + 1) * 100_000_000)
            yield number, files, replace(result, frame=frame)


class NoRecorder:
    """Takes the place of a recorder, and returns results with all their layers."""

    def encode(self, result: FrameResult, _position: int) -> FrameResult:
        """Return the result."""
        return result


def lines_of(result: FrameResult) -> dict[str, str]:
    """Return a frame's lines of the tables."""
    return csv_lines(Key("drive", "/camera/image"), frame_rows(result))


def hold(drive: Path, config: RunConfig) -> Held:
    """Run the pipeline once, before any clock runs, and return the work of the floor."""
    with open_log(drive, config) as log:
        run = prepare(log, config, ignore)
        results, sizes = [], []
        recorder = Recorder(drive.with_suffix(".held.rrd"), run.layout(), ALL)
        for position, (_, done) in enumerate(process([run], NoRecorder(), ignore)):
            result = done.encoded
            if position % max(1, -(-len(run.frames) * _bytes(result) // HELD_BYTES)) == 0:
                results.append(result)
                encoded = recorder.encode(result, position)
                sizes.append(_layer_bytes(encoded.payloads))
        frames = log.frames(run.selection)
        files = [_files(logged) for logged in frames]
        return Held(files, results, run.layout(), float(np.mean(sizes)))


def _files(logged: LoggedFrame) -> tuple[bytes, ...]:
    pictures = [logged.picture, *(label.picture for label in logged.labels.values())]
    return tuple(bytes(picture.data) for picture in pictures if not isinstance(picture, Exception))


def _layer_bytes(payloads: dict[str, bytes]) -> int:
    # Label images, if there are any, lie raw in a payload; the recording packs chunks with LZ4.
    logged = ("/camera", "/truth", "/true_shadow")
    layers = (payload for path, payload in payloads.items() if path not in logged)
    return sum(min(len(p), len(lz4.block.compress(p))) for p in layers)


def _bytes(result: FrameResult) -> int:
    contents = (layer.content for v in result.variants for layer in v.layers())
    return sum(c.bits.nbytes if isinstance(c, Packed) else c.nbytes for c in contents)


@contextmanager
def library_codecs() -> Iterator[None]:
    """Encode PNG files by OpenCV and zlib alone meanwhile.

    Both have the settings of their smallest files of masks and noisy maps. A floor of these codecs
    does not change when the recording's encoder becomes faster.
    """
    ours = codecs.crc32, codecs.compress, codecs.encode_levels

    def by_zlib(lines: np.ndarray) -> bytes:
        deflate = zlib.compressobj(1, zlib.DEFLATED, strategy=zlib.Z_RLE)
        return deflate.compress(lines.data) + deflate.flush()

    def by_opencv(levels: np.ndarray) -> bytes:
        channels = levels if levels.ndim == 2 else cv2.cvtColor(levels, cv2.COLOR_RGB2BGR)
        return cv2.imencode(".png", channels, NOISY)[1].tobytes()

    codecs.crc32, codecs.compress, codecs.encode_levels = zlib.crc32, by_zlib, by_opencv
    try:
        yield
    finally:
        codecs.crc32, codecs.compress, codecs.encode_levels = ours


def measure_floor(
    held: Held, folder: Path, jobs: int, codecs: AbstractContextManager[None]
) -> Cost:
    """Measure how long it takes to decode every file, and to encode and write the held layers.

    ``codecs`` is `library_codecs`, or a `nullcontext` for the recording's own encoder.
    """

    def work(item: tuple[int, tuple[bytes, ...], FrameResult]) -> Any:
        number, files, result = item
        for flags, data in zip((cv2.IMREAD_COLOR_RGB, *[-1] * 9), files, strict=False):
            cv2.imdecode(np.frombuffer(data, np.uint8), flags)
        return recorder.encode(result, number), lines_of(result)

    recorder = Recorder(folder / "floor.rrd", held.layout, ALL)
    meter = Meter()
    with codecs, recorder:
        for encoded, lines in map_ordered(work, held.frames(), jobs):
            recorder.write(encoded, lines)
        recorder.finish({})
    return meter.read()


def measure_loop(drive: Path, config: RunConfig, folder: Path) -> Cost:
    """Measure `replay` without its training, its summary and its figures."""
    with open_log(drive, config) as log:
        run = prepare(log, config, ignore)
        recorder = Recorder(folder / "loop.rrd", run.layout(), ALL)
        meter = Meter()
        with recorder, ResultsWriter(folder / "reports") as results:
            for _, done in process([run], recorder, ignore):
                recorder.write(done.encoded, done.lines)
                results.append(done.lines)
            recorder.finish({})
            cost = meter.read()
            sums = run.board.summary()
            results.append(csv_lines(run.key, sum_rows(run.board, sums.windows)))
            results.finish(summary.make_facts(run, sums, [], results.tables), "")
        return cost


def measure_replay(drive: Path, config: RunConfig, folder: Path) -> Cost:
    """Measure `replay` as a user calls it, with training, tables and figures."""
    meter = Meter()
    roadeval.replay(drive, config, save=folder / "out.rrd", reports=folder / "reports")
    return meter.read()
