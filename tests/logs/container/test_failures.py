"""Logs that earlier versions read wrongly without a word, or in no time that anybody has."""

import struct
import zlib
from pathlib import Path
from time import process_time

import pytest
from mcap.writer import CompressionType, Writer

from roadeval.logs.errors import LogError
from roadeval.logs.log import open_log
from tests.fixtures.shared import SHARED, shared

FAILURES = SHARED / "failures" if SHARED else None


def logged(path: Path, messages: int, *, first: int = 0, compression=CompressionType.NONE) -> bytes:
    """A log of JSON messages on one topic, some four in a chunk."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=2_000, compression=compression)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        for number in range(first, first + messages):
            data = b'{"n":%d,"fill":"%s"}' % (number, b"x" * 480)
            writer.add_message(channel, 1_000 * number, data, 1_000 * number)
        writer.finish()
    return path.read_bytes()


def read(tmp_path: Path, data: bytes) -> tuple[list[int], list[str]]:
    """The numbers of the messages that a log gives, and what is said about it."""
    path = tmp_path / "read.mcap"
    path.write_bytes(data)
    with open_log(path) as log:
        log.verify()
        counted = {topic.name: topic.count for topic in log.topics}
        return [counted.get("/a", 0)], [str(each) for each in log.damage]


@pytest.mark.parametrize("count", [1, 2, 3])
def test_logs_joined_end_to_end_are_read_one_after_the_other(tmp_path, count):
    parts = [logged(tmp_path / f"{n}.mcap", 12, first=12 * n) for n in range(count)]
    (found,), told = read(tmp_path, b"".join(parts))
    assert found == 12 * count
    assert sum("another log begins here" in each for each in told) == count - 1
    assert not any("are missing" in each for each in told)


def is_chunk(data: bytes, at: int) -> bool:
    opcode, length = struct.unpack_from("<BQ", data, at)
    if opcode != 6 or length > 100_000 or at + 9 + length > len(data) or length < 40:
        return False
    size, crc, name = struct.unpack_from("<QII", data, at + 25)
    if name > 4 or data[at + 41 : at + 41 + name] not in (b"", b"zstd", b"lz4"):
        return False
    (packed,) = struct.unpack_from("<Q", data, at + 41 + name)
    body = data[at + 49 + name : at + 49 + name + packed]
    return packed + 40 + name == length and (
        name or (len(body) == size and zlib.crc32(body) == crc)
    )


def test_a_chunk_that_lies_in_a_message_is_no_chunk_of_the_log(tmp_path):
    inner = logged(tmp_path / "inner.mcap", 8)
    with (tmp_path / "outer.mcap").open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, use_chunking=False)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        writer.add_message(channel, 0, inner, 0)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    (found,), _ = read(tmp_path, (tmp_path / "outer.mcap").read_bytes())
    assert found == 2


def test_a_log_that_is_a_link_to_itself_is_one_line(tmp_path):
    path = tmp_path / "loop.mcap"
    path.symlink_to(path)
    with pytest.raises(LogError) as caught:
        open_log(path)
    assert "\n" not in str(caught.value)


def test_millions_of_empty_records_take_seconds(tmp_path):
    import zstandard

    records = (b"\x80" + struct.pack("<Q", 0)) * 8_000_000
    packed = zstandard.compress(records)
    head = struct.pack("<QQQII", 0, 1, len(records), zlib.crc32(records), 4) + b"zstd"
    chunk = head + struct.pack("<Q", len(packed)) + packed
    data = logged(tmp_path / "whole.mcap", 4)
    at = next(at for at in range(len(data)) if is_chunk(data, at))
    began = process_time()
    (found,), told = read(
        tmp_path, data[:at] + b"\x06" + struct.pack("<Q", len(chunk)) + chunk + data[at:]
    )
    assert process_time() - began < 10
    assert found == 4
    assert told


def test_chunks_of_a_wrong_size_that_unpack_to_gigabytes_take_seconds(tmp_path):
    import zstandard

    packed = zstandard.compress(bytes(256 << 20))
    head = struct.pack("<QQQII", 0, 1, 1_000, 12_345, 4) + b"zstd"
    chunk = head + struct.pack("<Q", len(packed)) + packed
    record = b"\x06" + struct.pack("<Q", len(chunk)) + chunk
    data = logged(tmp_path / "whole.mcap", 4)
    at = next(at for at in range(len(data)) if is_chunk(data, at))
    began = process_time()
    (found,), told = read(tmp_path, data[:at] + 50 * record + data[at:])
    assert process_time() - began < 5
    assert found == 4
    assert told


@pytest.mark.skipif(FAILURES is None, reason="no shared data")
@pytest.mark.parametrize(
    ("name", "frames", "said"),
    [
        ("hole_in_chunk_0", 15, "lost: 4 of /camera/image"),
        ("schema_byte_changed", 6, "that is believed; messages fit it better"),
        ("schema_byte_intact", 6, ""),
    ],
)
def test_each_known_failure_is_read_and_said(name, frames, said):
    (path,) = shared("failures", f"{name}.mcap")
    began = process_time()
    with open_log(path) as log:
        log.verify()
        assert {topic.count for topic in log.topics} == {frames}
        told = " ".join(str(each) for each in log.damage)
    assert said in told
    assert bool(said) == bool(told)
    assert process_time() - began < 10
