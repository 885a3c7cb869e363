"""Random damage: never a crash, never a wrong frame unsaid, never a good frame lost."""

import random
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from mcap.writer import CompressionType, Writer
from mcap_ros2._dynamic import serialize_dynamic

from roadeval.logs import FrameError, LogError, open_log
from roadeval.logs.container import Container

from .making import COMPRESSED, IMAGE, compressed, grey, jpeg, raw

FRAMES = 12
PERIOD = 100_000_000
START = 1_700_000_000 * 10**9
CAMERA = "/camera"

CONTAINERS = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "uncompressed": {"compression": CompressionType.NONE},
    "unchunked": {"use_chunking": False},
}


@dataclass(frozen=True)
class Original:
    """An undamaged log, and for each frame its bytes in the file, first and last, and content."""

    data: bytes
    spans: dict[int, tuple[int, int]]
    payloads: dict[int, bytes]


def make(path: Path, container: str) -> Original:
    images = "sensor_msgs/msg/CompressedImage"
    masks = "sensor_msgs/msg/Image"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1500, enable_data_crcs=True, **CONTAINERS[container])
        writer.start("ros2", "test")
        for topic, name, text in ((CAMERA, images, IMAGE_TEXTS[0]), ("/labels", masks, IMAGE_TEXTS[1])):
            schema = writer.register_schema(name, "ros2msg", text.encode())
            writer.register_channel(topic, "cdr", schema)
        encode = [serialize_dynamic(images, COMPRESSED)[images], serialize_dynamic(masks, IMAGE)[masks]]
        payloads = {}
        for i in range(FRAMES):
            stamp = START + i * PERIOD
            payloads[stamp] = jpeg(grey(20 * i))
            writer.add_message(1, stamp, encode[0](compressed(stamp, payloads[stamp])), stamp, i)
            writer.add_message(2, stamp + 5, encode[1](raw(stamp, grey(255), "mono8")), stamp, i)
        writer.finish()
    return Original(path.read_bytes(), dict(spans(path)), payloads)


IMAGE_TEXTS = (COMPRESSED, IMAGE)


def spans(path: Path) -> Iterator[tuple[int, tuple[int, int]]]:
    """Where each image lies in the file: its chunk, or its own record."""
    container = Container(path, lambda *_: True, lambda *_: True)
    for number, entries in container.logs[1].blocks:
        for log_time, offset in entries.tolist():
            if number >= 0:
                chunk = container.chunks[number]
                yield log_time, (chunk.offset, chunk.data_offset + chunk.data_size)
            else:
                length = len(container.message(number, offset).data)
                yield log_time, (offset, offset + 31 + length)
    container.close()


@dataclass(frozen=True)
class Damaged:
    data: bytes
    first: int
    last: int


def flip(data: bytes, rng: random.Random) -> Damaged:
    at = rng.randrange(len(data))
    changed = bytearray(data)
    changed[at] ^= 1 << rng.randrange(8)
    return Damaged(bytes(changed), at, at)


def overwrite(data: bytes, rng: random.Random) -> Damaged:
    length = rng.choice((1, 2, 8, 40, 300, 2000))
    at = rng.randrange(len(data))
    length = min(length, len(data) - at)
    filling = rng.choice((bytes(length), b"\xff" * length, rng.randbytes(length)))
    return Damaged(data[:at] + filling + data[at + length :], at, at + length - 1)


def cut(data: bytes, rng: random.Random) -> Damaged:
    at = rng.randrange(len(data))
    return Damaged(data[:at], at, len(data))


def remove(data: bytes, rng: random.Random) -> Damaged:
    """Drop some bytes; what follows moves, so only what lies before is expected back."""
    length = rng.choice((1, 3, 50, 700))
    at = rng.randrange(len(data))
    return Damaged(data[:at] + data[at + length :], at, len(data))


KINDS = (flip, overwrite, cut, remove)


def read(path: Path) -> tuple[dict[int, tuple[int, bytes]], tuple[str, ...]]:
    """Stamp and bytes of the frames that decode, by log time, and what is said to be lost."""
    found = {}
    with open_log(path) as log:
        log.verify()
        for frame in log.frames(log.select(image=CAMERA, truth="")):
            try:
                decoded = frame.decode()
            except FrameError:
                continue
            found[decoded.log_time_ns] = (decoded.stamp_ns, bytes(decoded.payload))
        return found, log.losses


def check(original: Original, damaged: Damaged, path: Path) -> None:
    path.write_bytes(damaged.data)
    expected = {
        time
        for time, (begin, end) in original.spans.items()
        if end <= damaged.first or begin > damaged.last
    }
    try:
        found, losses = read(path)
    except LogError:
        assert not expected
        return
    wrong = {t for t, (stamp, data) in found.items() if original.payloads.get(t) != data or stamp != t}
    assert not wrong or losses
    assert expected <= set(found)
    assert losses or set(found) == set(original.payloads)


@pytest.mark.parametrize("container", CONTAINERS)
def test_damage_in_one_place(tmp_path: Path, container: str) -> None:
    original = make(tmp_path / "good.mcap", container)
    rng = random.Random(container)
    for _ in range(800):
        kind = rng.choice(KINDS)
        damaged = kind(original.data, rng)
        check(original, damaged, tmp_path / "bad.mcap")
