"""Logs that earlier versions read wrongly without a word, or in no time that anybody has."""

import zlib
from pathlib import Path
from time import process_time

import pytest
import zstandard
from mcap.writer import CompressionType, Writer

from roadeval.logs.errors import LogError
from roadeval.logs.log import open_log
from tests.fixtures import broken
from tests.fixtures.shared import shared
from tests.logs.making import chunk_record


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


def read(tmp_path: Path, data: bytes) -> tuple[int, list[str]]:
    """The number of messages that a log gives, and what is said about it."""
    path = tmp_path / "read.mcap"
    path.write_bytes(data)
    with open_log(path) as log:
        log.verify()
        return log.topics[0].count, [str(damage) for damage in log.damage]


@pytest.mark.parametrize("logs", [1, 2, 3])
def test_logs_joined_end_to_end_are_read_one_after_the_other(tmp_path, logs):
    parts = [logged(tmp_path / f"{n}.mcap", 12, first=12 * n) for n in range(logs)]
    count, damage_texts = read(tmp_path, b"".join(parts))
    assert count == 12 * logs
    assert sum("another log begins here" in damage for damage in damage_texts) == logs - 1
    assert "are missing" not in " ".join(damage_texts)


def test_a_chunk_that_lies_in_a_message_is_no_chunk_of_the_log(tmp_path):
    inner = logged(tmp_path / "inner.mcap", 8)
    with (tmp_path / "outer.mcap").open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, use_chunking=False)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        writer.add_message(channel, 0, inner, 0)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    count, _ = read(tmp_path, (tmp_path / "outer.mcap").read_bytes())
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
    count, damage_texts = read(tmp_path, data[:at] + chunks + data[at:])
    assert process_time() - began < seconds
    assert count == 4
    assert damage_texts


@pytest.mark.parametrize("folder", shared("failures"))
@pytest.mark.parametrize(
    ("name", "frames", "reason"),
    [
        ("hole_in_chunk_0", 15, "lost: 4 of /camera/image"),
        ("schema_byte_changed", 6, "that is believed; messages fit it better"),
        ("schema_byte_intact", 6, ""),
    ],
)
def test_each_known_failure_is_read_and_said(folder, name, frames, reason):
    began = process_time()
    with open_log(folder / f"{name}.mcap") as log:
        log.verify()
        assert {topic.count for topic in log.topics} == {frames}
        damage_text = " ".join(map(str, log.damage))
    assert reason in damage_text
    assert bool(reason) == bool(damage_text)
    assert process_time() - began < 10
