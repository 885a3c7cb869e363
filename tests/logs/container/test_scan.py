"""The walk from record to record, over what is damaged."""

import struct
from pathlib import Path

import lz4.frame
import pytest
import zstandard

from roadeval.logs.log import open_log
from roadeval.logs.settings import LogConfig, TopicSettings
from tests.fixtures.broken import mended
from tests.logs.making import CAMERA, FRAMES, START, small_log

MESSAGE = b"\x05"
CHUNK = b"\x06"
INDEX = b"\x07"
DATA_END = b"\x0f"
DATA_END_LENGTH = 9 + 4
FOOTER = 9 + 20 + 8
LENGTH_AT = 1


def kept(path: Path) -> list[int]:
    """Positions in the good log of the images that are kept whole."""
    with open_log(path, LogConfig(topics=TopicSettings(image=CAMERA, truth=""))) as log:
        frames = [frame.decode() for frame in log.frames(log.select())]
    return [round(float(frame.image.mean()) / 20) for frame in frames]


def records(data: bytes, opcode: bytes) -> list[int]:
    """Offsets of the records of a kind outside chunks."""
    found, at = [], 8
    while at < len(data) - 8:
        if data[at : at + 1] == opcode:
            found.append(at)
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    return found


def changed(path: Path, at: int, data: bytes) -> Path:
    whole = path.read_bytes()
    path.write_bytes(whole[:at] + data + whole[at + len(data) :])
    return path


@pytest.fixture
def unchunked(tmp_path: Path) -> Path:
    """Images and labels in turn, each a record of its own."""
    path = tmp_path / "log.mcap"
    small_log(path, "unchunked")
    return path


@pytest.fixture
def chunked(tmp_path: Path) -> Path:
    path = tmp_path / "log.mcap"
    small_log(path, "zstd")
    return path


@pytest.mark.parametrize("longer", [-40, -1, 1, 3, 40, 700])
def test_an_image_of_wrong_length_costs_only_itself(unchunked: Path, longer: int) -> None:
    data = unchunked.read_bytes()
    at = records(data, MESSAGE)[6]
    length = int.from_bytes(data[at + 1 : at + 9], "little") + longer
    found = kept(changed(unchunked, at + LENGTH_AT, length.to_bytes(8, "little")))
    assert set(range(FRAMES)) - set(found) <= {3}


def test_a_wrong_message_index_costs_nothing_and_no_order(chunked: Path) -> None:
    good = chunked.read_bytes()
    at = records(good, INDEX)[3]
    channel, entries = at + 9, at + 9 + 2 + 4
    assert good[channel] == 1, "the second chunk's index of the camera"
    for byte in range(entries, entries + 3 * 16):
        chunked.write_bytes(good)
        assert kept(changed(chunked, byte, bytes([good[byte] ^ 4]))) == [*range(FRAMES)]


def test_a_wrong_message_index_is_noted(chunked: Path) -> None:
    second_offset = records(chunked.read_bytes(), INDEX)[3] + 9 + 2 + 4 + 16 + 8
    with open_log(changed(chunked, second_offset, b"?")) as log:
        for frame in log.frames(log.select()):
            frame.decode()
        assert "message index of a chunk is wrong" in str(log.damage[0])
        assert log.losses == ()


@pytest.mark.parametrize("offset", range(8))
def test_a_wrong_byte_at_the_very_beginning_is_forgiven(chunked: Path, offset: int) -> None:
    changed(chunked, offset, b"?")
    assert kept(chunked) == [*range(FRAMES)]
    with open_log(chunked) as log:
        assert log.losses == ()
        assert "does not begin as it should" in str(log.damage[0])


@pytest.mark.parametrize("container", ["unchunked", "zstd"])
def test_a_missing_record_at_the_end_of_the_data_is_no_loss(tmp_path: Path, container: str) -> None:
    path = tmp_path / "log.mcap"
    small_log(path, container)
    data = path.read_bytes()
    at = records(data, DATA_END)[0]
    footer = bytearray(data[-FOOTER:])
    start = int.from_bytes(footer[9:17], "little") - DATA_END_LENGTH
    # Writers that leave this record out give no checksums, and no offsets of summary sections.
    footer[9:29] = start.to_bytes(8, "little") + bytes(12)
    path.write_bytes(data[:at] + data[at + DATA_END_LENGTH : -FOOTER] + footer)
    assert kept(path) == [*range(FRAMES)]
    with open_log(path) as log:
        log.verify()
        assert log.losses == ()
        assert "the record that ends the data is missing" in str(log.damage[0])


def test_a_footer_that_points_into_the_data_ends_nothing(unchunked: Path) -> None:
    data = bytearray(unchunked.read_bytes())
    footer = len(data) - FOOTER
    data[footer + 9 : footer + 29] = records(data, MESSAGE)[6].to_bytes(8, "little") + bytes(12)
    unchunked.write_bytes(data)
    assert kept(unchunked) == [*range(FRAMES)]


def with_chunk(path: Path, compression: str, data: bytes, size: int) -> None:
    """Put a chunk in front of all others of a log, and leave its summary out."""
    small_log(path, "uncompressed")
    log = path.read_bytes()
    end, begin = records(log, DATA_END)[0], 8 + 9 + int.from_bytes(log[9:17], "little")
    # Its times are those of the log, so that no message lies before what was its first one.
    head = struct.pack("<QQQII", START, START, size, 0, len(compression)) + compression.encode()
    chunk = head + struct.pack("<Q", len(data)) + data
    chunk = b"\x06" + struct.pack("<Q", len(chunk)) + chunk
    tail = DATA_END + struct.pack("<QI", 4, 0) + b"\x02" + struct.pack("<Q", 20) + bytes(20)
    path.write_bytes(log[:begin] + chunk + log[begin:end] + tail + log[:8])


SIZE = 9 * (2 << 20)
"""A whole number of empty records, so that zeros would add up if they were taken for them."""
COMPRESSED_ZEROS = {
    "zstd": zstandard.ZstdCompressor(write_content_size=False).compress(bytes(SIZE)),
    "lz4": lz4.frame.compress(bytes(SIZE), store_size=False),
}


@pytest.mark.parametrize("compression", COMPRESSED_ZEROS)
def test_zeros_in_place_of_records_are_told_and_not_walked_through(tmp_path, compression):
    path = tmp_path / "log.mcap"
    with_chunk(path, compression, COMPRESSED_ZEROS[compression], SIZE)
    assert kept(path) == [*range(FRAMES)]
    with open_log(path) as log:
        assert "a chunk whose records do not add up" in log.losses[0]


@pytest.mark.parametrize("compression", COMPRESSED_ZEROS)
def test_a_chunk_that_grows_beyond_all_bounds_is_given_up(tmp_path, compression, monkeypatch):
    monkeypatch.setattr("roadeval.logs.container.records.LARGEST_CHUNK", 10 << 20)
    path = tmp_path / "log.mcap"
    with_chunk(path, compression, COMPRESSED_ZEROS[compression], SIZE)
    assert kept(path) == [*range(FRAMES)]
    with open_log(path) as log:
        assert "a chunk of more than 10485760 bytes" in log.losses[0]


def test_two_descriptions_of_a_topic_outside_chunks_are_told(unchunked: Path) -> None:
    """Which is right nothing tells: the summary has a checksum, the data was what messages met."""
    whole = unchunked.read_bytes()
    name = b"sensor_msgs/msg/CompressedImage"
    last = whole.rindex(name)
    wrong = whole[:last] + name.replace(b"sensor", b"tensor") + whole[last + len(name) :]
    unchunked.write_bytes(mended(wrong))
    with open_log(unchunked) as log:
        told, *_ = log.losses
    assert "a topic is described here in another way" in told


def test_topics_are_read_as_the_data_describes_them(chunked: Path) -> None:
    """The summary's copy of a definition may say something else under a checksum that is right."""
    whole = chunked.read_bytes()
    wrong = whole.replace(b"string format\nuint8[] data", b"string format\nuint8[] dota")
    assert wrong != whole
    chunked.write_bytes(mended(wrong))
    assert kept(chunked) == list(range(FRAMES))
    with open_log(chunked) as log:
        told, *_ = log.losses
    assert "described here in another way than before" in told


def test_a_message_without_room_for_its_head_is_damage_and_costs_no_image(unchunked: Path) -> None:
    data = unchunked.read_bytes()
    at = records(data, MESSAGE)[6]
    short = MESSAGE + (10).to_bytes(8, "little") + data[at + 9 : at + 19]
    unchunked.write_bytes(data[:at] + short + data[at:])
    assert kept(unchunked) == [*range(FRAMES)]
    with open_log(unchunked) as log:
        assert "of a length that cannot be" in log.losses[0]


@pytest.mark.parametrize("opcode", [0, 4, 5, 9, 0x0F, 0x87])
def test_a_message_index_under_another_kind_costs_nothing(chunked: Path, opcode: int) -> None:
    at = records(chunked.read_bytes(), INDEX)[3]
    assert kept(changed(chunked, at, bytes([opcode]))) == [*range(FRAMES)]


def test_a_chunk_that_calls_itself_an_attachment_is_read_without_any_summary(chunked: Path) -> None:
    data = chunked.read_bytes()
    chunked.write_bytes(data[: records(data, DATA_END)[0]])
    at = records(data, CHUNK)[1]
    assert kept(changed(chunked, at, b"\x09")) == [*range(FRAMES)]
