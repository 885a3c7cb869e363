"""How cost grows: with the image's size, the drive's length, the number of drives, the distance.

    python -m benchmarks.scale --write

Frames of the demo drive, resized and repeated. ``--write`` puts the tables into
docs/explanation/speed.md. All of it takes some twenty minutes on two cores.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import time
from collections.abc import Iterator, Sequence
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Any, Final

import cv2
import numpy as np
import rerun as rr
from mcap.reader import make_reader

from benchmarks.drives import Source, jpeg_of, resized, write
from benchmarks.intervals import show
from benchmarks.processes import CommandCost, run
from benchmarks.timing import timed
from roadeval.data import Frame
from roadeval.logs.writing.writer import LogWriter
from tests.pipeline import reference

ROOT: Final = Path(__file__).resolve().parents[1]
DEMO: Final = ROOT / "recordings" / "demo.mcap"
PAGE: Final = ROOT / "docs" / "explanation" / "speed.md"
SIZES: Final = (640, 480), (1280, 720), (1920, 1200)
SMALL: Final = (320, 240)
"""The size of long drives and of fleets."""
RECORD: Final = ("all", "masks", "none")
LENGTHS: Final = (40, 160)
"""Frames of two replays; what the longer one costs more is the cost of its further frames."""
DRIVE_FRAMES: Final = 20
DELAYS_MS: Final = (0, 30)
SURE_S: Final = 0.3
"""CPU seconds that are more than chance."""
HOURS: Final = 5_000
RATE_HZ: Final = 10
PARTS: Final = ("sizes", "yardsticks", "growth", "rig", "far")


def main() -> None:
    """Measure the chosen parts, and print their tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scale")
    parser.add_argument("--parts", choices=PARTS, nargs="+", default=PARTS)
    parser.add_argument("--repeat", type=int, default=3, help="runs of which the median counts")
    parser.add_argument("--frames", type=int, default=20_000, help="of the longest drive")
    parser.add_argument("--drives", type=int, default=500, help="of the largest fleet")
    parser.add_argument("--write", action="store_true", help="into the page, too")
    options = parser.parse_args()
    frames = Source(DEMO).frames(100)
    for part in options.parts:
        with TemporaryDirectory(prefix="roadeval-scale-") as folder:
            if part == "sizes":
                lines = sizes(frames, Path(folder), options.repeat)
            elif part == "yardsticks":
                lines = yardsticks(frames, Path(folder))
            elif part == "growth":
                lines = growth(frames, Path(folder), options.frames, options.drives)
            elif part == "rig":
                lines = rig(frames, Path(folder))
            else:
                lines = far(frames, Path(folder))
            show(part, lines, write=options.write, page=PAGE)


def markdown(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yield the lines of a Markdown table of rows with equal keys."""
    yield f"| {' | '.join(rows[0])} |"
    yield f"|---{'|---:' * (len(rows[0]) - 1)}|"
    yield from (f"| {' | '.join(map(str, row.values()))} |" for row in rows)


def replay(drive: Path, folder: Path, *words: object) -> CommandCost:
    """Replay a drive into a folder."""
    places = "--save", folder / "out.rrd", "--reports", folder / "reports"
    return run("replay", drive, *places, "--quiet", *words)


def sizes(frames: list[Frame], folder: Path, repeat: int) -> Iterator[str]:
    """Yield what a frame costs by its size, by what is recorded, and by the number of jobs."""
    rows, core_ms = [], 0.0
    for size in SIZES:
        logs = [write(folder / f"{n}.mcap", frames, size, n) for n in LENGTHS]
        further = LENGTHS[1] - LENGTHS[0]
        for record in RECORD:
            speeds = {}
            for jobs in (2, 1):
                words = "--jobs", jobs, "--record", record
                pairs, bytes_of = [], dict[Path, int]()
                for _ in range(repeat):
                    pairs.append([replay(log, folder / log.stem, *words) for log in logs])
                for log in logs:
                    recording = folder / log.stem / "out.rrd"
                    bytes_of[log] = recording.stat().st_size if record != "none" else 0
                walls = [long.wall - short.wall for short, long in pairs]
                speeds[jobs] = further / median(walls)
            cpu_ms = 1e3 * median([long.cpu - short.cpu for short, long in pairs]) / further
            if (size, record) == (SIZES[0], "none"):
                core_ms = cpu_ms
            recorded = (bytes_of[logs[1]] - bytes_of[logs[0]]) / further
            rows.append(
                {
                    "size": "{} x {}".format(*size),
                    "`--record`": record,
                    "frames/s, 1 job": f"{speeds[1]:.0f}",
                    "2 jobs": f"{speeds[2]:.0f}",
                    "CPU, ms a frame": f"{cpu_ms:.1f}",
                    "peak, MiB": f"{max(long.peak_mib for _, long in pairs):.0f}",
                    "recording, kB a frame": f"{recorded / 1e3:.0f}" if recorded else "",
                }
            )
    yield from markdown(rows)
    total = HOURS * 3600 * RATE_HZ
    hours = total * core_ms / 3.6e6
    yield ""
    yield (
        f"{HOURS:,} hours at {RATE_HZ} Hz are {total / 1e6:.0f} million frames: {hours:.0f} core "
        f"hours at {core_ms:.1f} ms each, {hours / 96:.1f} hours on a cluster of 96 cores."
    )


def yardsticks(frames: list[Frame], folder: Path) -> Iterator[str]:
    """Yield what a frame costs by other means, beside ours without a recording."""
    frames, rows = frames[:40], []
    for size in SIZES:
        log = write(folder / "drive.mcap", frames, size)
        logs = [write(folder / f"{n}.mcap", frames, size, n) for n in LENGTHS]
        words = "--jobs", 1, "--record", "none"
        short, long = (replay(log, folder / log.stem, *words) for log in logs)
        ours = (long.cpu - short.cpu) / (LENGTHS[1] - LENGTHS[0])
        pictures = [resized(frame, *size) for frame in frames]
        cv2.setNumThreads(1)
        model = reference.train(*colours_of(pictures[:10]))
        table = decisions_by_colour(model)
        decode(log)
        reading = timed(partial(decode, log))[1] / len(frames)
        fast = [timed(partial(opencv_way, *pair, model, table))[1] for pair in pictures]
        plain = [timed(partial(plain_way, image, model)) for image, _ in pictures[10:12]]
        plain_s = min(seconds for _, seconds in plain)
        stream = rr.RecordingStream("scale")
        stream.save(folder / "plain.rrd")
        logged = [timed(partial(log_plainly, stream, layers))[1] for layers, _ in 3 * plain]
        rows.append(
            {
                "ms a frame": "{} x {}".format(*size),
                "decode: mcap, OpenCV": f"{1e3 * reading:.1f}",
                "OpenCV, unrecorded": f"{1e3 * (median(fast) + reading):.1f}",
                "roadeval, unrecorded, scored": f"{1e3 * ours:.1f}",
                "NumPy and scikit-image": f"{1e3 * plain_s:.0f}",
                "`rr.log` of its layers": f"{1e3 * median(logged):.1f}",
            }
        )
    yield from markdown(rows)


def growth(frames: list[Frame], folder: Path, most: int, drives: int) -> Iterator[str]:
    """Yield what ten times the frames and ten times the drives cost."""
    counts, by_length = [most // 100, most // 10, most], list[dict[str, CommandCost]]()
    for count in counts:
        log = write(folder / "long.mcap", frames, SMALL, count)
        results = folder / f"long_{count}"
        page, reports = results / "page.html", results / "reports"
        by_length.append(
            {
                "replay, without a recording": replay(log, results, "--record", "none"),
                "page": run("report", reports, "-o", page),
                "PDF": run("report", reports, "-o", results / "report.pdf"),
                "compare": run("compare", reports, reports),
            }
        )
    yield from markdown(grown(by_length, [f"{count:,} frames" for count in counts]))
    yield ""
    small = write(folder / "short.mcap", frames, SMALL, DRIVE_FRAMES)
    counts, by_number = [drives // 100, drives // 10, drives], list[dict[str, CommandCost]]()
    for count in counts:
        logs, results = folder / f"logs_{count}", folder / f"fleet_{count}"
        logs.mkdir()
        for number in range(count):
            shutil.copy(small, logs / f"drive_{number}.mcap")
        words = "--record", "none", "--quiet"
        by_number.append(
            {
                f"fleet, {DRIVE_FRAMES} frames a drive": run("fleet", logs, "-o", results, *words),
                "the same again": run("fleet", logs, "-o", results, *words),
                "page": run("report", results, "-o", folder / "page.html"),
                "compare": run("compare", results, results),
            }
        )
    yield from markdown(grown(by_number, [f"{count} drives" for count in counts]))
    bytes_ = sum(path.stat().st_size for path in results.rglob("*") if path.is_file())
    yield ""
    yield f"The results of the {drives} drives are {bytes_ / 1e6:.0f} MB."


def grown(columns: list[dict[str, CommandCost]], titles: list[str]) -> list[dict[str, str]]:
    """Return CPU seconds by command, and how many times the work costs if it is ten times as much.

    The fixed cost is left out: the third cost less the second, over the second less the first. That
    says nothing if the second costs as good as no more than the first.
    """
    rows = []
    for name in columns[0]:
        costs = [column[name] for column in columns]
        seconds = [cost.cpu for cost in costs]
        first, further = np.diff(seconds)
        rows.append(
            {
                "CPU, s": name,
                **{title: f"{cpu:.1f}" for title, cpu in zip(titles, seconds, strict=True)},
                "growth": f"{further / first:.1f}" if first > SURE_S else "",
                "peak, MiB": f"{costs[-1].peak_mib:.0f}",
            }
        )
    return rows


def rig(frames: list[Frame], folder: Path) -> Iterator[str]:
    """Yield what six cameras cost beside one of them."""
    pictures = [(jpeg_of(image), truth) for image, truth in (resized(f, *SMALL) for f in frames)]
    cameras, rows = [f"/camera_{number}" for number in range(6)], []
    with LogWriter(folder / "rig.mcap") as log:
        for number in range(len(pictures)):
            for place, camera in enumerate(cameras):
                jpeg, truth = pictures[(number + 7 * place) % len(pictures)]
                log.image(f"{camera}/image", number * 10**8, jpeg, "jpeg")
                log.mask(f"{camera}/road_mask", number * 10**8, truth)
    for count in (1, 6):
        results = folder / f"of_{count}"
        topics = [word for c in cameras[:count] for word in ("--image-topic", f"{c}/image")]
        cost = replay(folder / "rig.mcap", results, *topics)
        page, recording = results / "page.html", results / "out.rrd"
        paged = run("report", recording, "-o", page)
        rows.append(
            {
                "cameras": count,
                "replay, CPU s": f"{cost.cpu:.1f}",
                "peak, MiB": f"{cost.peak_mib:.0f}",
                "recording, MB": f"{recording.stat().st_size / 1e6:.1f}",
                "page, CPU s": f"{paged.cpu:.1f}",
                "page, kB": f"{page.stat().st_size / 1e3:.0f}",
            }
        )
    yield from markdown(rows)


def far(frames: list[Frame], folder: Path) -> Iterator[str]:
    """Yield what a log behind a URL costs, at several times from a request to its answer."""
    log = write(folder / "far.mcap", frames, SIZES[1], 1500)
    commands: dict[str, tuple[str, ...]] = {
        "`info`": ("info",),
        "a replay of 3 s": ("replay", "--start", "60", "--end", "63", "--record", "none"),
        "a replay of all": ("replay", "--record", "none", "--every", "10"),
    }
    rows = []
    for name, (command, *words) in commands.items():
        for delay in DELAYS_MS:
            with Server(log, delay / 1e3) as server:
                url = f"http://127.0.0.1:{server.server_port}/{log.name}"
                places = ("--reports", folder / "reports", "--quiet") if words else ()
                cost = run(command, url, *words, *places)
                here = run(command, log, *words, *places)
                rows.append(
                    {
                        "a log over HTTP": name,
                        "ms a request": delay,
                        "requests": server.requests,
                        "MB": f"{server.sent / 1e6:.1f}",
                        "of the log": f"{100 * server.sent / log.stat().st_size:.1f} %",
                        "seconds": f"{cost.wall:.1f}",
                        "from the disk": f"{here.wall:.1f}",
                    }
                )
    yield from markdown(rows)


class Server(ThreadingHTTPServer):
    """Serves one file by ranges, each answer after a delay in seconds."""

    daemon_threads = True

    def __init__(self, path: Path, delay_s: float) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.path, self.delay_s, self.size = path, delay_s, path.stat().st_size
        self.requests = self.sent = 0

    def __enter__(self) -> Server:
        Thread(target=self.serve_forever, args=(0.05,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.shutdown()
        self.server_close()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Server

    def do_HEAD(self) -> None:
        self._answer()

    def do_GET(self) -> None:
        self._answer()

    def _answer(self) -> None:
        time.sleep(self.server.delay_s)
        size = self.server.size
        asked = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
        begin, end = (int(asked[1]), int(asked[2] or size - 1) + 1) if asked else (0, size)
        end = min(end, size)
        self.send_response(206 if asked else 200)
        self.send_header("ETag", '"1"')
        self.send_header("Accept-Ranges", "bytes")
        self.send_header("Content-Length", str(end - begin))
        if asked:
            self.send_header("Content-Range", f"bytes {begin}-{end - 1}/{size}")
        self.end_headers()
        self.server.requests += 1
        if self.command == "GET":
            with self.server.path.open("rb") as file:
                self.server.sent += os.sendfile(
                    self.wfile.fileno(), file.fileno(), begin, end - begin
                )

    def log_message(self, *_: Any) -> None:
        """Stay silent."""


# --- The same work by other means -----------------------------------------------------------------


def decode(log: Path) -> None:
    """Decode every image of a log, with `mcap` and OpenCV alone."""
    with log.open("rb") as file:
        for _, _, message in make_reader(file).iter_messages():
            begin = max(message.data.find(b"\xff\xd8\xff"), message.data.find(b"\x89PNG"))
            cv2.imdecode(np.frombuffer(message.data, np.uint8, offset=begin), cv2.IMREAD_UNCHANGED)


def colours_of(pictures: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Draw 2000 colours and whether they are road."""
    rng = np.random.default_rng(0)
    colours = np.concatenate([image.reshape(-1, 3) for image, _ in pictures])
    road = np.concatenate([truth.ravel() for _, truth in pictures]) == 1
    chosen = np.concatenate([rng.choice(np.flatnonzero(road == side), 1000) for side in (0, 1)])
    return colours[chosen], road[chosen]


def decisions_by_colour(model: Any) -> np.ndarray:
    """Return what the SVM says of each colour, ``(2^24,)`` bool, by its blue, green and red bits.

    Every eighth level is asked, for the speed does not depend on what the table says.
    """
    levels = np.arange(4, 256, 8)
    colours = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), -1).reshape(-1, 3)
    says = model.machine.predict(colours).astype(bool).reshape(32, 32, 32)
    return np.kron(says.transpose(2, 1, 0), np.ones((8, 8, 8), bool)).ravel()


def plain_way(image: np.ndarray, model: Any) -> dict[str, np.ndarray]:
    """Return the layers of both variants, by the pipeline of the tests."""
    variants = {"filtered": True, "unfiltered": False}
    return {
        f"{name}/{layer}": array
        for name, filtered in variants.items()
        for layer, array in reference.layers(image, model, filtered=filtered).items()
    }


def log_plainly(stream: rr.RecordingStream, layers: dict[str, np.ndarray]) -> None:
    """Log a frame's layers as they are."""
    for name, array in layers.items():
        if array.ndim == 3:
            stream.log(name, rr.Image(array))
        elif array.dtype == np.float64:
            stream.log(name, rr.DepthImage(array.astype(np.float32)))
        else:
            stream.log(name, rr.SegmentationImage(array.astype(np.uint8)))
    stream.flush()


def _ndi_codes() -> np.ndarray:
    """Return the 8-bit code of NDI by the sum of a pixel's channels and the least of them."""
    total, least = np.mgrid[:766, :256].astype(float)
    saturation = np.where(total > 0, 1 - 3 * least / np.maximum(total, 1), 0)
    value = total / 765
    ndi = (saturation - value) / np.maximum(saturation + value, 1e-9)
    return np.rint((ndi + 1) * 127.5).clip(0, 255).astype(np.uint8).ravel()


_NDI: Final = _ndi_codes()


def opencv_way(image: np.ndarray, truth: np.ndarray, model: Any, table: np.ndarray) -> None:
    """Run both variants by OpenCV's fastest functions, and count the final masks' outcomes.

    The work is the paper's, the masks are not quite ours: neighbouring shadows share their rings,
    distances have 32 bits, and `decisions_by_colour` are rough.
    """
    kernel = np.ones((max(3, 2 * (image.shape[1] // 200) + 1),) * 2, np.uint8)
    root = np.linalg.cholesky(np.linalg.inv(model.road.covariance_ + np.eye(3))).T
    whiten = np.hstack([root, -(root @ model.road.location_)[:, None]])
    for picture in (_compensated(image), image):
        whitened = cv2.transform(picture.astype(np.float32), whiten)
        squares = cv2.transform(cv2.multiply(whitened, whitened), np.ones((1, 3)))
        cv2.compare(squares, reference.CHI2_95, cv2.CMP_LE)
        packed = cv2.cvtColor(picture, cv2.COLOR_RGB2BGRA).view(np.uint32)[..., 0] & 0xFFFFFF
        road = cv2.morphologyEx(table[packed].view(np.uint8), cv2.MORPH_OPEN, kernel)
        road = cv2.morphologyEx(road, cv2.MORPH_CLOSE, kernel)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(road)
        outside = cv2.compare(labels, 1.0 + stats[1:, cv2.CC_STAT_AREA].argmax(), cv2.CMP_NE)
        outside = cv2.copyMakeBorder(outside, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=255)
        cv2.floodFill(outside, None, (0, 0), 1)
        final = cv2.compare(outside[1:-1, 1:-1], 1, cv2.CMP_NE)
        for masks in ((final, truth), (final, final), (truth, truth)):
            cv2.countNonZero(cv2.bitwise_and(*masks))


def _compensated(image: np.ndarray) -> np.ndarray:
    """Return the image after the shadow filter: Otsu's threshold of NDI, and Eq. 11 by shadow."""
    channels = cv2.split(image)
    total = cv2.add(cv2.add(channels[0], channels[1], dtype=cv2.CV_16U), channels[2], dtype=2)
    least = cv2.min(cv2.min(channels[0], channels[1]), channels[2])
    codes = _NDI[total.astype(np.int32) << 8 | least]
    _, shadow = cv2.threshold(codes, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    count, inside = cv2.connectedComponents(shadow)
    around = cv2.dilate(inside.astype(np.float32), np.ones((3, 3), np.uint8)).astype(np.int32)
    around[inside > 0] = 0
    pixels, moments = image.reshape(-1, 3), []
    for image_labels in (inside.ravel(), around.ravel()):
        places = np.flatnonzero(image_labels)
        labels, colours = image_labels[places], pixels[places].T.astype(np.float64)
        size = np.maximum(np.bincount(labels, minlength=count), 1)
        mean = np.array([np.bincount(labels, channel, count) for channel in colours]) / size
        square = np.array([np.bincount(labels, channel, count) for channel in colours**2]) / size
        moments.append((mean, np.sqrt(np.maximum(square - mean**2, 0)), places, labels))
    (mean, deviation, places, labels), (mean_around, deviation_around, *_) = moments
    gain = (deviation_around / np.maximum(deviation, 1e-9)).astype(np.float32)
    shift = (mean_around - mean * gain + 0.5).astype(np.float32)
    lifted = pixels[places].T * np.take(gain, labels, 1) + np.take(shift, labels, 1)
    result = image.copy()
    result.reshape(-1, 3)[places] = np.clip(lifted, 0, 255).T.astype(np.uint8)
    return result


if __name__ == "__main__":
    main()
