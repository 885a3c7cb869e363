"""Chunks that are intact are read, whatever is damaged beside them; what earlier ones misread."""

import zlib
from collections.abc import Callable
from pathlib import Path
from time import process_time

import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from roadeval.logs.errors import LogError
from roadeval.logs.log import open_log
from tests.fixtures import broken
from tests.fixtures.broken import HEAD, data_end, length_of, mended, over, records
from tests.fixtures.shared import shared
from tests.fuzz.intact import FRAMES, Intact, Reading, intact_logs, read
from tests.logs.making import chunk_record

START, SIZE, DATA_SIZE, NAME = 9, 25, 41, 37
"""Offsets in a chunk: its start time, the size of its records, the size of its data if its name is
empty, and the length of the name."""

Damage = Callable[[Intact], bytes]


def places(log: Intact, opcode: Opcode) -> list[int]:
    """Return where records of a kind begin."""
    return list(records(log.data, opcode))


def more(data: bytes, at: int, by: int, width: int = 8) -> bytes:
    """Make a number larger."""
    number = int.from_bytes(data[at : at + width], "little") + by
    return over(data, at, number.to_bytes(width, "little"))


def data_size(log: Intact) -> bytes:
    """Let the first chunk claim more compressed data than there is: it ends all the same."""
    at = places(log, Opcode.CHUNK)[0]
    return more(log.data, at + DATA_SIZE + log.data[at + NAME], 64)


def records_size(log: Intact) -> bytes:
    """Let a chunk claim more records than its data holds; its checksum is right."""
    return more(log.data, places(log, Opcode.CHUNK)[2] + SIZE, 1)


def start_behind_damage(log: Intact) -> bytes:
    """Change a chunk's start, and the kind of the record before it."""
    at = places(log, Opcode.CHUNK)[2]
    before = max(end for _, end, _ in log.records if end < at)
    return over(more(log.data, at + START, 1), before, b"\x03")


def index_to_the_end(log: Intact) -> bytes:
    """Let a message index reach to the last eight bytes, and damage the summary."""
    at = places(log, Opcode.MESSAGE_INDEX)[3]
    length = len(log.data) - 8 - at - HEAD
    data = more(log.data, data_end(log.data) + 40, 1, 1)
    return over(data, at + 1, length.to_bytes(8, "little"))


def head_twice(log: Intact) -> bytes:
    """Repeat the first eight bytes of a chunk in front of it."""
    at = places(log, Opcode.CHUNK)[2]
    return log.data[: at + 8] + log.data[at:]


def first_bytes_missing(log: Intact) -> bytes:
    """Leave out what the file begins with; this one has no end either."""
    return log.data[8:]


def beginning_missing(log: Intact) -> bytes:
    """Leave out all before the first chunk."""
    return log.data[places(log, Opcode.CHUNK)[0] :]


def channel_in_the_summary(log: Intact) -> bytes:
    """Let a damaged summary describe the camera's topic by another number as well."""
    at = places(log, Opcode.CHANNEL)[0]
    return over(log.data, at + HEAD, bytes(4))


def number_of_labels_in_the_summary(log: Intact) -> bytes:
    """Number the labels' topic otherwise: what describes it lies where no label does."""
    at = places(log, Opcode.CHANNEL)[1] + HEAD
    return mended(over(log.data, at, b"\xff\xff"))


def beside(log: Intact, tmp_path: Path, damage: Damage) -> tuple[Reading, list[int]]:
    """Read a damaged log; also list the frames that are not read as they were logged."""
    path = tmp_path / "drive.mcap"
    path.write_bytes(damage(log))
    reading = read(path)
    frames = log.frames.items()
    return reading, [log.number_of(frame[0]) for frame in frames if frame not in reading.frames]


@pytest.mark.parametrize(
    ("kind", "damage", "reason"),
    [
        ("zstd", data_size, ""),
        ("lz4", data_size, ""),
        ("no_index", data_size, ""),
        ("no_index", records_size, ""),
        ("zstd", start_behind_damage, ""),
        ("uncompressed", index_to_the_end, "lengths contradict"),
        ("no_index", head_twice, "8 bytes too many"),
        ("no_index", channel_in_the_summary, ""),
        ("unfinished", first_bytes_missing, "never finished"),
        ("unfinished", beginning_missing, "never finished"),
        ("uncompressed", channel_in_the_summary, ""),
        ("uncompressed", number_of_labels_in_the_summary, ""),
    ],
)
def test_every_frame_is_read(tmp_path, kind, damage, reason):
    reading, other = beside(intact_logs()[kind], tmp_path, damage)
    assert len(reading.frames) == FRAMES, reading.told
    assert not other
    assert reason in " | ".join(reading.told)
    assert bool(reason) or not reading.told


@pytest.mark.parametrize("by", [-1, 1, 64])
def test_no_message_of_a_chunk_whose_checksum_cannot_be_right_is_read(tmp_path, by):
    """Whether its lengths contradict each other as well, or not."""
    log = intact_logs()["uncompressed"]
    at = places(log, Opcode.CHUNK)[3]

    def damage(log: Intact) -> bytes:
        data = more(log.data, data_end(log.data) + 40, 1, 1)  # the summary cannot help
        data = more(data, at + 1, by)
        mask = at + length_of(log.data, at) - 20
        return over(data, mask, bytes([data[mask] ^ 7]))

    reading, other = beside(log, tmp_path, damage)
    touched = [time for time, blocks in log.blocks.items() if at in (begin for begin, _ in blocks)]
    assert set(other) <= set(map(log.number_of, touched))
    assert reading.told
    assert all(frame == log.frames[time] for time, frame in reading.frames if frame.truth)


def test_an_unchunked_log_whose_data_hides_its_topics_is_read_by_the_summarys_records(tmp_path):
    def damage(log: Intact) -> bytes:
        at = places(log, Opcode.CHANNEL)[0] + 24
        return log.data[:at] + bytes(512) + log.data[at:]

    reading, other = beside(intact_logs()["unchunked"], tmp_path, damage)
    assert not other
    assert "512 bytes too many" in " ".join(reading.told)


def logged(path: Path, messages: int, first: int = 0) -> bytes:
    """A log of JSON messages on one topic, some four in a chunk."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=2_000, compression=CompressionType.NONE)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        for number in range(first, first + messages):
            data = b'{"n":%d,"fill":"%s"}' % (number, b"x" * 480)
            writer.add_message(channel, 1_000 * number, data, 1_000 * number)
        writer.finish()
    return path.read_bytes()


def told_of(tmp_path: Path, data: bytes) -> tuple[int, list[str]]:
    """The number of messages that a log gives, and what is said about it."""
    path = tmp_path / "read.mcap"
    path.write_bytes(data)
    with open_log(path) as log:
        log.verify()
        return log.topics[0].count, [str(damage) for damage in log.damage]


@pytest.mark.parametrize("logs", [1, 2, 3])
def test_logs_joined_end_to_end_are_read_one_after_the_other(tmp_path, logs):
    parts = [logged(tmp_path / f"{n}.mcap", 12, first=12 * n) for n in range(logs)]
    count, told = told_of(tmp_path, b"".join(parts))
    assert count == 12 * logs
    assert sum("another log begins here" in damage for damage in told) == logs - 1
    assert "are missing" not in " ".join(told)


def test_a_chunk_that_lies_in_a_message_is_no_chunk_of_the_log(tmp_path):
    inner = logged(tmp_path / "inner.mcap", 8)
    with (tmp_path / "outer.mcap").open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, use_chunking=False)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        writer.add_message(channel, 0, inner, 0)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    count, _ = told_of(tmp_path, (tmp_path / "outer.mcap").read_bytes())
    assert count == 2


def test_a_log_that_is_a_link_to_itself_is_one_line(tmp_path):
    path = tmp_path / "loop.mcap"
    path.symlink_to(path)
    with pytest.raises(LogError) as caught:
        open_log(path)
    assert "\n" not in str(caught.value)


def millions_of_empty_records() -> bytes:
    records = (b"\x80" + bytes(8)) * 8_000_000
    return chunk_record(zstandard.compress(records), "zstd", len(records), zlib.crc32(records))


def chunks_of_a_wrong_size_that_unpack_to_gigabytes() -> bytes:
    return 50 * chunk_record(zstandard.compress(bytes(256 << 20)), "zstd", 1_000, 12_345)


@pytest.mark.parametrize(
    ("bomb", "seconds"),
    [(millions_of_empty_records, 10), (chunks_of_a_wrong_size_that_unpack_to_gigabytes, 5)],
)
def test_bombs_take_seconds(tmp_path, bomb, seconds):
    data, chunks = logged(tmp_path / "whole.mcap", 4), bomb()
    at = broken.chunk(0, data)
    began = process_time()
    count, told = told_of(tmp_path, data[:at] + chunks + data[at:])
    assert process_time() - began < seconds
    assert count == 4
    assert told


@pytest.mark.parametrize("folder", shared("failures"))
@pytest.mark.parametrize(
    ("name", "frames", "said"),
    [
        ("hole_in_chunk_0", 15, "lost: 4 of /camera/image"),
        ("schema_byte_changed", 6, "that is believed; messages fit it better"),
        ("schema_byte_intact", 6, ""),
    ],
)
def test_each_known_failure_is_read_and_said(folder, name, frames, said):
    began = process_time()
    with open_log(folder / f"{name}.mcap") as log:
        log.verify()
        assert {topic.count for topic in log.topics} == {frames}
        told = " ".join(map(str, log.damage))
    assert said in told
    assert bool(said) == bool(told)
    assert process_time() - began < 10
