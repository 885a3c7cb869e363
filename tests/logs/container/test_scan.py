"""The walk from record to record, over what is damaged."""

import struct
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode

from roadeval.logs.log import open_log
from roadeval.logs.settings import LogConfig, TopicSettings
from tests.fixtures import broken
from tests.fixtures.broken import (
    HEAD,
    LENGTH_AT,
    chunk,
    data_end,
    good,
    length_of,
    mended,
    over,
)
from tests.logs.making import CAMERA, FRAMES, START, chunk_record, small_log

FOOTER = HEAD + 20 + 8


def kept(path: Path) -> list[int]:
    """Positions in the good log of the images that are kept whole."""
    with open_log(path, LogConfig(topics=TopicSettings(image=CAMERA, truth=""))) as log:
        frames = [frame.decode() for frame in log.frames(log.select())]
    return [round(float(frame.image.mean()) / 20) for frame in frames]


def records(data: bytes, opcode: Opcode) -> list[int]:
    """Offsets of the records of a kind outside chunks."""
    return list(broken.records(data, opcode))


def changed(path: Path, at: int, data: bytes) -> Path:
    path.write_bytes(over(path.read_bytes(), at, data))
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
    at = records(data, Opcode.MESSAGE)[6]
    length = length_of(data, at) - HEAD + longer
    found = kept(changed(unchunked, at + LENGTH_AT, length.to_bytes(8, "little")))
    assert set(range(FRAMES)) - set(found) <= {3}


def test_a_wrong_message_index_costs_nothing_and_no_order(chunked: Path) -> None:
    good = chunked.read_bytes()
    at = records(good, Opcode.MESSAGE_INDEX)[3]
    channel, entries = at + 9, at + 9 + 2 + 4
    assert good[channel] == 1, "the second chunk's index of the camera"
    for byte in range(entries, entries + 3 * 16):
        chunked.write_bytes(good)
        assert kept(changed(chunked, byte, bytes([good[byte] ^ 4]))) == [*range(FRAMES)]


def test_a_wrong_message_index_is_noted(chunked: Path) -> None:
    second_offset = records(chunked.read_bytes(), Opcode.MESSAGE_INDEX)[3] + 9 + 2 + 4 + 16 + 8
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
    at = data_end(data)
    start = int.from_bytes(data[-FOOTER + HEAD :][:8], "little") - length_of(data, at)
    # Writers that leave this record out give no checksums, and no offsets of summary sections.
    footer = over(data[-FOOTER:], HEAD, start.to_bytes(8, "little") + bytes(12))
    path.write_bytes(data[:at] + data[at + length_of(data, at) : -FOOTER] + footer)
    assert kept(path) == [*range(FRAMES)]
    with open_log(path) as log:
        log.verify()
        assert log.losses == ()
        assert "the record that ends the data is missing" in str(log.damage[0])


def test_a_footer_that_points_into_the_data_ends_nothing(unchunked: Path) -> None:
    data = unchunked.read_bytes()
    start = records(data, Opcode.MESSAGE)[6].to_bytes(8, "little")
    path = changed(unchunked, len(data) - FOOTER + HEAD, start + bytes(12))
    assert kept(path) == [*range(FRAMES)]


SIZE = 9 * (2 << 20)
"""A whole number of empty records, so that zeros would add up if they were taken for them."""
COMPRESSED_ZEROS = {
    "zstd": zstandard.ZstdCompressor(write_content_size=False).compress(bytes(SIZE)),
    "lz4": lz4.frame.compress(bytes(SIZE), store_size=False),
}


@pytest.mark.parametrize("compression", COMPRESSED_ZEROS)
@pytest.mark.parametrize(
    ("largest", "told"),
    [
        (1 << 30, "a chunk whose records do not add up"),
        (10 << 20, "a chunk of more than 10485760 bytes"),
    ],
)
def test_zeros_in_place_of_records_are_told_and_given_up_if_they_grow_beyond_all_bounds(
    tmp_path, monkeypatch, compression, largest, told
):
    """They lie in front of all other chunks, in a log without a summary."""
    monkeypatch.setattr("roadeval.logs.container.records.LARGEST_CHUNK", largest)
    path = tmp_path / "log.mcap"
    small_log(path, "uncompressed")
    log = path.read_bytes()
    begin, end = 8 + length_of(log, 8), data_end(log)
    # Its times are those of the log, so that no message lies before what was its first one.
    chunk = chunk_record(COMPRESSED_ZEROS[compression], compression, SIZE, start=START)
    tail = b"\x0f" + struct.pack("<QI", 4, 0) + b"\x02" + struct.pack("<Q", 20) + bytes(20)
    path.write_bytes(log[:begin] + chunk + log[begin:end] + tail + log[:8])
    assert kept(path) == [*range(FRAMES)]
    with open_log(path) as opened:
        assert told in opened.losses[0]


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
    at = records(data, Opcode.MESSAGE)[6]
    short = b"\x05" + (10).to_bytes(8, "little") + data[at + 9 : at + 19]
    unchunked.write_bytes(data[:at] + short + data[at:])
    assert kept(unchunked) == [*range(FRAMES)]
    with open_log(unchunked) as log:
        assert "of a length that cannot be" in log.losses[0]


@pytest.mark.parametrize("opcode", [0, 4, 5, 9, 0x0F, 0x87])
def test_a_message_index_under_another_kind_costs_nothing(chunked: Path, opcode: int) -> None:
    at = records(chunked.read_bytes(), Opcode.MESSAGE_INDEX)[3]
    assert kept(changed(chunked, at, bytes([opcode]))) == [*range(FRAMES)]


def test_a_chunk_that_calls_itself_an_attachment_is_read_without_any_summary(chunked: Path) -> None:
    data = chunked.read_bytes()
    chunked.write_bytes(data[: data_end(data)])
    at = records(data, Opcode.CHUNK)[1]
    assert kept(changed(chunked, at, b"\x09")) == [*range(FRAMES)]


CHUNK_LENGTH_AT = HEAD + 8 + 8 + 8
"""Where a chunk index has the length of its chunk."""


def without(number: int, data: bytes) -> bytes:
    """Leave a chunk out."""
    at = chunk(number, data)
    return data[:at] + data[at + length_of(data, at) :]


@pytest.mark.parametrize("length", [0, 1, 1 << 62])
def test_an_index_of_a_chunk_that_cannot_be_so_long_is_not_followed(tmp_path, length):
    """One of no length would lead back to its own chunk, again and again."""
    data = good()
    at = records(data, Opcode.CHUNK_INDEX)[0]
    path = tmp_path / "drive.mcap"
    path.write_bytes(mended(over(data, at + CHUNK_LENGTH_AT, length.to_bytes(8, "little"))))
    with open_log(path) as log:
        assert log.topics[0].count == broken.FRAMES


def left_out() -> tuple[bytes, str]:
    """Leave a chunk out though all others are sound."""
    return without(3, good()), f"{length_of(good(), chunk(3, good()))} bytes are missing before it"


def repeated() -> tuple[bytes, str]:
    data, at = good(), chunk(3, good())
    length = length_of(data, at)
    return data[:at] + data[at : at + length] + data[at:], f"{length} bytes too many lie before it"


def without_an_end() -> tuple[bytes, str]:
    """Leave counts behind the data, which tell what is missing."""
    return without(3, good())[:-20], "lost: 2 of /cam/image/compressed"


def without_a_summary() -> tuple[bytes, str]:
    """Leave only the checksum of all data, which is wrong."""
    data = broken.log(enable_data_crcs=True).bytes()
    end = data_end(data)
    damaged = without(3, data[: end + length_of(data, end)])
    return damaged, "nothing tells which messages are wrong or missing"


def of_wrong_records() -> tuple[bytes, str]:
    """Change a length in a chunk under a checksum that is right."""
    data = broken.log(use_statistics=False, compression=broken.CompressionType.NONE).bytes()
    places = broken.inside(data, chunk(3, data))
    message = next(at for at in places if data[at] == Opcode.MESSAGE)
    damaged = mended(over(data, message + broken.LENGTH_AT, broken.ABSURD))
    return damaged, "records do not add up"


@pytest.mark.parametrize(
    "damage", [left_out, repeated, without_an_end, without_a_summary, of_wrong_records]
)
def test_a_chunk_that_is_missing_repeated_or_wrong_is_told(tmp_path, damage):
    data, told = damage()
    path = tmp_path / "drive.mcap"
    path.write_bytes(data)
    with open_log(path) as log:
        log.verify()
        assert told in " | ".join(log.losses)
