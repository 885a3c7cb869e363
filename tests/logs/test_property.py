"""Random damage: never a crash, never a wrong frame unsaid, never a good frame lost."""

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from roadeval.logs import FrameError, LogConfig, LogError, TopicSettings, open_log
from roadeval.logs.container.file import OUTSIDE, Container, containers_in
from tests.logs.making import CAMERA, CONTAINERS, small_log

CASES = 250
"""Random cases for each container of a finished log, and half as many for an unfinished one."""

RECORD_HEADS = 31
"""Bytes before a message's data: its record's head and its own."""


@dataclass(frozen=True)
class Good:
    """A good log: its bytes; by log time, where each image lies and its file; two borders."""

    data: bytes
    spans: dict[int, tuple[int, int]]
    images: dict[int, bytes]
    definitions_end: int
    data_end: int


@dataclass(frozen=True)
class Bad:
    """The bytes of a damaged log, and the first and last of them that are damaged."""

    data: bytes
    first: int
    last: int


def places(container: Container) -> Iterator[tuple[int, tuple[int, int]]]:
    """By log time, the bytes of the file that an image hangs on: its chunk's, or its own."""
    for number, entries in container.logs[1].blocks:
        for log_time, offset in entries.tolist():
            if number == OUTSIDE:
                length = len(container.message(number, offset).data)
                yield log_time, (offset, offset + RECORD_HEADS + length)
            else:
                chunk = container.chunks[number]
                yield log_time, (chunk.offset, chunk.data_offset + chunk.data_size)


def make(path: Path, name: str) -> Good:
    images = small_log(path, name)
    data = path.read_bytes()
    (container,) = containers_in(path, lambda *_: True, lambda *_: 0)
    spans = dict(places(container))
    container.close()
    data_end = data.index(b"\x0f\x04" + bytes(7))
    definitions_end = min(spans.values())[0 if name == "unchunked" else 1]
    return Good(data, spans, images, definitions_end, data_end)


def flip(data: bytes, rng: random.Random) -> Bad:
    at = rng.randrange(len(data))
    changed = bytearray(data)
    changed[at] ^= 1 << rng.randrange(8)
    return Bad(bytes(changed), at, at)


def overwrite(data: bytes, rng: random.Random) -> Bad:
    at = rng.randrange(len(data))
    length = min(rng.choice((1, 2, 8, 40, 300, 2000)), len(data) - at)
    filling = rng.choice((bytes(length), b"\xff" * length, rng.randbytes(length)))
    return Bad(data[:at] + filling + data[at + length :], at, at + length - 1)


def cut(data: bytes, rng: random.Random) -> Bad:
    at = rng.randrange(len(data))
    return Bad(data[:at], at, len(data))


def remove(data: bytes, rng: random.Random) -> Bad:
    """Drop some bytes: what follows moves away from where any index says it is."""
    at = rng.randrange(len(data))
    return Bad(data[:at] + data[at + rng.choice((1, 3, 50, 700)) :], at, len(data))


KINDS: tuple[Callable[[bytes, random.Random], Bad], ...] = (flip, overwrite, cut, remove)


def read(path: Path) -> tuple[dict[int, tuple[int, bytes]], tuple[str, ...]]:
    """Stamp and file of every image that decodes, by log time; and what is said to be lost."""
    found = {}
    only = LogConfig(topics=TopicSettings(image=CAMERA, truth=""))
    with open_log(path, only) as log:
        log.verify()
        for logged in log.frames(log.select()):
            try:
                frame = logged.decode()
            except FrameError:
                continue
            found[frame.log_time_ns] = (frame.stamp_ns, bytes(frame.payload))
        return found, log.losses


def check(good: Good, bad: Bad, expected: set[int], path: Path) -> None:
    path.write_bytes(bad.data)
    try:
        found, losses = read(path)
    except LogError:
        assert not expected, "no frame was kept"
        return
    right = {time for time, frame in found.items() if frame == (time, good.images.get(time))}
    assert losses or right == set(found), "a wrong frame was not reported"
    assert losses or right == set(good.images), "a lost frame was not reported"
    assert expected <= right, "a good frame was lost"


def untouched(good: Good, bad: Bad) -> set[int]:
    return {
        time for time, (begin, end) in good.spans.items() if end <= bad.first or begin > bad.last
    }


@pytest.mark.parametrize("container", CONTAINERS)
def test_damage_to_a_finished_log(tmp_path: Path, container: str) -> None:
    good = make(tmp_path / "good.mcap", container)
    rng = random.Random(container)
    for case in range(CASES):
        bad = rng.choice(KINDS)(good.data, rng)
        try:
            check(good, bad, untouched(good, bad), tmp_path / "bad.mcap")
        except Exception as error:
            error.add_note(f"case {case}, bytes {bad.first} to {bad.last}")
            raise


@pytest.mark.parametrize("container", CONTAINERS)
def test_damage_to_a_log_that_was_never_finished(tmp_path: Path, container: str) -> None:
    """Without a summary, what channels there are stands only where the first message is."""
    good = make(tmp_path / "good.mcap", container)
    rng = random.Random(container)
    for case in range(CASES // 2):
        bad = rng.choice(KINDS)(good.data[: good.data_end], rng)
        expected = untouched(good, bad) if bad.first >= good.definitions_end else set()
        try:
            check(good, bad, expected, tmp_path / "bad.mcap")
        except Exception as error:
            error.add_note(f"case {case}, bytes {bad.first} to {bad.last}")
            raise
