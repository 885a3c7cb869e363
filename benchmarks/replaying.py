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
from roadeval.recording.recorder import recorder_for
from roadeval.results.folder import ResultsWriter
from roadeval.results.rows import Key, csv_lines, frame_rows, sum_rows
from roadeval.runtime.threads import ordered

ALL: Final = RecordRule.parse("all")
NOISY: Final = (
    *(cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_PAETH),
    *(cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE),
)
HELD_BYTES: Final = 400 << 20
"""Of layers computed beforehand and held for the floor, which goes round them."""


@dataclass(frozen=True)
class Held:
    """What the floor works on: files to decode, and finished frames to encode and write."""

    files: list[tuple[bytes, ...]]
    results: list[FrameResult]
    layout: Any
    layer_bytes: float
    """Encoded, a frame, beyond the camera's own file and the truths."""

    def frames(self) -> Iterator[tuple[int, tuple[bytes, ...], FrameResult]]:
        """Yield every frame's number and files, with one of the held results."""
        for number, files in enumerate(self.files):
            result = self.results[number % len(self.results)]
            frame = replace(result.frame, number=number, stamp_ns=(number + 1) * 100_000_000)
            yield number, files, replace(result, frame=frame)


class Whole:
    """Stands where a recorder does, and hands out what it is given, layers and all."""

    def encode(self, result: FrameResult, _position: int) -> FrameResult:
        """Return the result."""
        return result


def lines_of(result: FrameResult) -> dict[str, str]:
    """Return a frame's lines of the tables."""
    return csv_lines(Key("drive", "/camera/image"), frame_rows(result))


def hold(drive: Path, config: RunConfig) -> Held:
    """Run the pipeline once, before any clock runs, and keep what the floor needs."""
    with open_log(drive, config) as log:
        run = prepare(log, config, ignore)
        results, sizes = [], []
        recorder = recorder_for(drive.with_suffix(".held.rrd"), run.layout(), ALL)
        for position, (_, done) in enumerate(process([run], Whole(), ignore)):
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
    return tuple(bytes(each.data) for each in pictures if not isinstance(each, Exception))


def _layer_bytes(payloads: dict[str, bytes]) -> int:
    # Label images, if there are any, lie raw in a payload; the recording packs chunks with LZ4.
    given = ("/camera", "/truth", "/true_shadow")
    mine = (payload for path, payload in payloads.items() if path not in given)
    return sum(min(len(p), len(lz4.block.compress(p))) for p in mine)


def _bytes(result: FrameResult) -> int:
    contents = (layer.content for v in result.variants for layer in v.layers())
    return sum(c.bits.nbytes if isinstance(c, Packed) else c.nbytes for c in contents)


@contextmanager
def library_codecs() -> Iterator[None]:
    """Have PNG files encoded by OpenCV and zlib alone meanwhile.

    Both with the settings that make their smallest files of masks and noisy maps. A floor of these
    stays what it is when the recording's encoder becomes faster.
    """
    own = codecs.crc32, codecs.compress, codecs.encode_levels

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
        codecs.crc32, codecs.compress, codecs.encode_levels = own


def floor(held: Held, folder: Path, jobs: int, codecs: AbstractContextManager[None]) -> Cost:
    """Decode every file, encode and write the held layers, and no more.

    ``codecs`` is `library_codecs`, or a `nullcontext` for the recording's own encoder.
    """

    def work(item: tuple[int, tuple[bytes, ...], FrameResult]) -> Any:
        number, files, result = item
        for flags, data in zip((cv2.IMREAD_COLOR_RGB, *[-1] * 9), files, strict=False):
            cv2.imdecode(np.frombuffer(data, np.uint8), flags)
        return recorder.encode(result, number), lines_of(result)

    recorder = recorder_for(folder / "floor.rrd", held.layout, ALL)
    meter = Meter()
    with codecs, recorder:
        for encoded, lines in ordered(work, held.frames(), jobs):
            recorder.write(encoded, lines)
        recorder.finish({})
    return meter.read()


def loop(drive: Path, config: RunConfig, folder: Path) -> Cost:
    """Do what `replay` does, without its training, its summary and its figures."""
    with open_log(drive, config) as log:
        run = prepare(log, config, ignore)
        recorder = recorder_for(folder / "loop.rrd", run.layout(), ALL)
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


def whole(drive: Path, config: RunConfig, folder: Path) -> Cost:
    """Call `replay` as a user does: training, tables and figures too."""
    meter = Meter()
    roadeval.replay(drive, config, save=folder / "out.rrd", reports=folder / "reports")
    return meter.read()
