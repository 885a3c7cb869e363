"""Costs of a run on a long log: bytes read, time, memory, the recording.

python -m benchmarks.long_logs [--gigabytes 1] [--files 1] [--folder FOLDER] [--parts info ...]

It writes a log as a robot's recorder does, by the `mcap` libraries, and runs commands on it. Bytes
are those that a process reads from the system (``rchar`` in ``/proc/self/io``), less those of
``--help``, which reads the program itself; only on Linux.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import cv2
import numpy as np
from mcap.writer import CompressionType
from mcap_ros2.writer import Writer

from benchmarks.drives import COMPRESSED, NESTED, Source, jpeg_of, resized
from benchmarks.timing import table

SIZE: Final = (1920, 1200)
CAMERAS: Final = ("front", "front_left", "front_right", "rear_left", "rear_right")
PERIOD_NS: Final = 50_000_000
CHUNK: Final = 4 << 20
CLOUD: Final = 1_600_000
"""Bytes of one turn of the lidar."""
BEGIN_NS: Final = 1_700_000_000_000_000_000

_RULER: Final = "=" * 80
_VECTOR: Final = "float64 x\nfloat64 y\nfloat64 z\n"
_QUATERNION: Final = f"{_VECTOR}float64 w\n"


def _of(name: str, text: str) -> str:
    return f"\n{_RULER}\nMSG: {name}\n{text}"


BYTES: Final = "robot_msgs/msg/Bytes"
"""Types of messages that roadeval does not read: of a lidar, of an IMU."""
MESSAGES: Final = {
    "sensor_msgs/msg/CompressedImage": COMPRESSED,
    BYTES: f"std_msgs/Header header\nuint8[] data\n{NESTED}",
    "sensor_msgs/msg/CameraInfo": (
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\n"
        "float64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\n"
        "uint32 binning_y\nsensor_msgs/RegionOfInterest roi\n"
        + NESTED
        + _of(
            "sensor_msgs/RegionOfInterest",
            "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n",
        )
    ),
    "tf2_msgs/msg/TFMessage": (
        "geometry_msgs/TransformStamped[] transforms\n"
        + _of(
            "geometry_msgs/TransformStamped",
            "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
        )
        + _of(
            "geometry_msgs/Transform",
            "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        )
        + _of("geometry_msgs/Vector3", _VECTOR)
        + _of("geometry_msgs/Quaternion", _QUATERNION)
        + NESTED
    ),
}
"""The schemas of the messages, by their names."""


class Recorder:
    """A recorder of ROS 2 messages into files of one log."""

    def __init__(self, folder: Path, files: int, size: int) -> None:
        self._folder, self._limit = folder, size // files
        self._names: list[str] = []
        self._begin()
        self.written = 0

    def _begin(self) -> None:
        name = f"{self._folder.name}_{len(self._names)}.mcap"
        self._names.append(name)
        self._file = (self._folder / name).open("wb")
        self._writer = Writer(self._file, chunk_size=CHUNK, compression=CompressionType.ZSTD)
        self._schemas = {
            name: self._writer.register_msgdef(name, text) for name, text in MESSAGES.items()
        }

    def write(self, topic: str, name: str, message: dict[str, Any], time_ns: int) -> None:
        """Write a message, a dictionary by the schema's fields."""
        self._writer.write_message(topic, self._schemas[name], message, time_ns, time_ns)

    def end_tick(self, size: int) -> bool:
        """Begin the next file where one is full; return whether the log is as long as asked."""
        if self.written + self._file.tell() >= size:
            return True
        if self._file.tell() >= self._limit:
            self._end()
            self._begin()
        return False

    def _end(self) -> None:
        self._writer.finish()
        self.written += self._file.tell()
        self._file.close()

    def close(self) -> None:
        """End the last file, and write the metadata of a folder of files."""
        self._end()
        paths = "".join(f"    - {name}\n" for name in self._names)
        (self._folder / "metadata.yaml").write_text(
            "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n"
            f"  relative_file_paths:\n{paths}"
        )


def write(folder: Path, source: Source, gigabytes: float, files: int = 1) -> Path:
    """Write a log of about so many bytes; several files make a folder."""
    pictures = [_noisy(*resized(frame, *SIZE)) for frame in source.frames(40)]
    cloud = np.random.default_rng(0).integers(0, 256, CLOUD, np.uint8).tobytes()
    folder.mkdir(parents=True)
    size = round(gigabytes * 1e9)
    recorder = Recorder(folder, files, size)
    for tick in count():
        now = BEGIN_NS + tick * PERIOD_NS
        for number, name in enumerate(CAMERAS):
            at = now + number * 1_000_000
            image, truth = pictures[(tick + 7 * number) % len(pictures)]
            header = _header(at, f"cam_{name}")
            topic = f"/cameras/{name}"
            kind = "sensor_msgs/msg/CompressedImage"
            message = {"header": header, "format": "jpeg", "data": _commented(image, tick)}
            recorder.write(f"{topic}/image/compressed", kind, message, at + 30_000_000)
            info = "sensor_msgs/msg/CameraInfo"
            recorder.write(f"{topic}/camera_info", info, _info(header), at + 30_000_000)
            if number == 0 and tick % 20 == 0:
                labels = {"header": header, "format": "png", "data": truth}
                recorder.write("/labels/front/semantic", kind, labels, at + 35_000_000)
        _others(recorder, tick, now, cloud)
        if recorder.end_tick(size):
            break
    recorder.close()
    return folder if files > 1 else next(folder.glob("*.mcap"))


def _noisy(image: np.ndarray, truth: np.ndarray) -> tuple[bytes, bytes]:
    """Return an image as JPEG, with the noise that enlarging took away, and its truth as PNG."""
    noise = np.random.default_rng(len(image)).normal(0, 2.5, image.shape)
    image = np.clip(image + noise, 0, 255).astype(np.uint8)
    return jpeg_of(image), cv2.imencode(".png", truth)[1].tobytes()


def _commented(image: bytes, tick: int) -> bytes:
    """Return a JPEG file with a comment, for a file that was trained on is evaluated nowhere."""
    text = str(tick).encode()
    return b"".join((image[:2], b"\xff\xfe", (2 + len(text)).to_bytes(2, "big"), text, image[2:]))


def _others(recorder: Recorder, tick: int, now: int, cloud: bytes) -> None:
    for part in range(5):  # 100 Hz
        at = now + part * PERIOD_NS // 5
        recorder.write("/imu", BYTES, {"header": _header(at, "imu"), "data": bytes(296)}, at)
    turn = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    placed = {"translation": {"x": tick * 0.5, "y": 0.0, "z": 0.0}, "rotation": turn}
    transform = {"header": _header(now, "map"), "child_frame_id": "base", "transform": placed}
    recorder.write("/tf", "tf2_msgs/msg/TFMessage", {"transforms": [transform]}, now)
    if tick % 2 == 0:
        points = {"header": _header(now, "lidar"), "data": cloud}
        recorder.write("/lidar/points", BYTES, points, now + 40_000_000)


def _header(at: int, frame: str) -> dict[str, Any]:
    seconds, rest = divmod(at, 1_000_000_000)
    return {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": frame}


def _info(header: dict[str, Any]) -> dict[str, Any]:
    width, height = SIZE
    k = [1500.0, 0, width / 2, 0, 1500.0, height / 2, 0, 0, 1.0]
    return {
        "header": header,
        "height": height,
        "width": width,
        "distortion_model": "plumb_bob",
        "d": [0.0] * 5,
        "k": k,
        "r": [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0],
        "p": [*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0],
        "binning_x": 1,
        "binning_y": 1,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }


# The numbers of a process as it ends. The peak of memory in /proc begins anew with a new program,
# unlike the system's count for a finished child.
_END: Final = """
import atexit, os, sys
from pathlib import Path

def end():
    lines = [line.split() for name in ("io", "status") for line in Path("/proc/self", name).open()]
    numbers = {words[0]: words[1] for words in lines if len(words) > 1}
    used = os.times()
    Path(os.environ["COST"]).write_text(f"{numbers['rchar:']} {sum(used[:2])} {numbers['VmHWM:']}")

atexit.register(end)
"""
_ROADEVAL: Final = f"{_END}\nfrom roadeval.cli.app import main\nsys.exit(main())"
_SEEKING: Final = f"""{_END}
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

topics = ["/cameras/front/image/compressed", "/labels/front/semantic"]
for path in sys.argv[2:]:
    with open(path, "rb") as file:
        for place, _ in enumerate(
            make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(topics)
        ):
            if place + 1 == int(sys.argv[1]):
                break
"""
_SHA256: Final = f"""{_END}
import hashlib
for path in sys.argv[1:]:
    with open(path, "rb") as file:
        print(hashlib.file_digest(file, "sha256").hexdigest())
"""


def measure(code: str, *words: object) -> dict[str, Any]:
    """Run a program; return the bytes that it has read, and its time and memory."""
    first, last, start = "", "", perf_counter()
    with (
        tempfile.NamedTemporaryFile("r") as cost,
        subprocess.Popen(
            [sys.executable, "-c", code, *map(str, words)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "COST": cost.name},
        ) as process,
    ):
        assert process.stderr is not None
        for line in process.stderr:
            if not first and "replaying: 1 of" in line:
                first = f"{perf_counter() - start:.2f}"
            last = line
        if process.wait():
            raise RuntimeError(f"{words} ended with {process.returncode}: {last}")
        wall = perf_counter() - start
        read, cpu, peak = cost.read().split()
    return {
        "read": int(read),
        "wall, s": f"{wall:.2f}",
        "CPU, s": f"{float(cpu):.2f}",
        "first frame, s": first,
        "peak, MiB": int(peak) >> 10,
    }


def costs(drive: Path, folder: Path, parts: list[str]) -> Iterator[dict[str, Any]]:
    """Yield the cost of each command on a log."""
    files = sorted(drive.glob("*.mcap")) if drive.is_dir() else [drive]
    out, reports = folder / "out.rrd", folder / "reports"
    replay = "replay", drive, "--image-topic", "/cameras/front/image/compressed"
    replay = *replay, "--save", out, "--reports", reports
    topics = [f"/cameras/{name}/image/compressed" for name in CAMERAS]
    rig = "replay", drive, *(word for topic in topics for word in ("--image-topic", topic))
    rig = *rig, "--save", folder / "rig.rrd", "--reports", folder / "rig"
    every: dict[str, tuple[Any, ...]] = {
        "sha256sum": (_SHA256, *files),
        "seeking": (_SEEKING, 53, *files),
        "info": (_ROADEVAL, "info", drive),
        "verify": (_ROADEVAL, "info", "--verify", drive),
        "fifty": (_ROADEVAL, *replay, "--max-frames", 50, "--model", folder / "front.model"),
        "labelled": (_ROADEVAL, *replay, "--every", 20, "--train-frames", 3),
        "replay": (_ROADEVAL, *replay, "--train-frames", 3),
        "rig": (_ROADEVAL, *rig, "--train-frames", 3),
        "pdf": (_ROADEVAL, "report", out, "-o", folder / "report.pdf"),
        "page": (_ROADEVAL, "report", out, "-o", folder / "report.html"),
    }
    size = sum(file.stat().st_size for file in files)
    start_up = measure(_ROADEVAL, "--help")["read"]
    if "fifty" in parts:
        train = "train", drive, "--image-topic", "/cameras/front/image/compressed"
        measure(_ROADEVAL, *train, "--train-frames", 3, "-o", folder / "front.model")
    for name in parts:
        costs = measure(*every[name])
        read = max(costs.pop("read") - start_up, 0)
        saved = folder / "rig.rrd" if name == "rig" else out
        made = saved.stat().st_size if "replay" in every[name] else 0
        yield {
            "what": name,
            "read, MB": f"{read / 1e6:.0f}",
            "of the log": f"{read / size:.3f}",
            **costs,
            "recording, MB": f"{made / 1e6:.0f}" if made else "",
        }


PARTS: Final = (
    *("sha256sum", "seeking", "info", "verify", "fifty", "labelled", "replay"),
    *("rig", "pdf", "page"),
)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.long_logs", description=__doc__)
    parser.add_argument("--drive", type=Path, default=Path("recordings/demo.mcap"))
    parser.add_argument("--gigabytes", type=float, default=1.0)
    parser.add_argument("--files", type=int, default=1, help="of the log")
    parser.add_argument(
        "--folder", type=Path, help="folder of the log, which stays and is used again"
    )
    parser.add_argument("--parts", choices=PARTS, nargs="+", default=PARTS)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = options.folder or Path(name)
        place = folder / f"long_{options.gigabytes:g}_{options.files}"
        if place.exists():
            drive = place if options.files > 1 else next(place.glob("*.mcap"))
        else:
            drive = write(place, Source(options.drive), options.gigabytes, options.files)
        print(table(f"{options.gigabytes:g} GB", [*costs(drive, folder, options.parts)]))


if __name__ == "__main__":
    main()
