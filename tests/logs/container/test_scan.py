"""The walk from record to record, over what is damaged."""

from pathlib import Path

import pytest

from roadeval.logs import LogError, TopicSettings, open_log
from tests.logs.making import CAMERA, FRAMES, small_log

MESSAGE = b"\x05"
INDEX = b"\x07"
DATA_END = b"\x0f"
DATA_END_LENGTH = 9 + 4
FOOTER = 9 + 20 + 8
LENGTH_AT = 1


def kept(path: Path) -> list[int]:
    """Positions in the good log of the images that are kept whole."""
    with open_log(path) as log:
        frames = [
            frame.decode()
            for frame in log.frames(log.select(TopicSettings(image=CAMERA, truth="")))
        ]
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


@pytest.mark.parametrize("longer", [-40, -1, 1, 3, 40])
def test_a_label_of_wrong_length_costs_no_image(unchunked: Path, longer: int) -> None:
    data = unchunked.read_bytes()
    at = records(data, MESSAGE)[7]
    length = int.from_bytes(data[at + 1 : at + 9], "little") + longer
    assert kept(changed(unchunked, at + LENGTH_AT, length.to_bytes(8, "little"))) == [
        *range(FRAMES)
    ]


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


@pytest.mark.parametrize("opcode", [0, 4, 5, 9, 0x0F, 0x87])
def test_a_message_index_under_another_kind_costs_nothing(chunked: Path, opcode: int) -> None:
    at = records(chunked.read_bytes(), INDEX)[3]
    assert kept(changed(chunked, at, bytes([opcode]))) == [*range(FRAMES)]


@pytest.mark.parametrize("offset", range(8))
def test_a_wrong_byte_at_the_very_beginning_is_forgiven(chunked: Path, offset: int) -> None:
    changed(chunked, offset, b"?")
    assert kept(chunked) == [*range(FRAMES)]
    with open_log(chunked) as log:
        assert log.losses == ()
        assert "does not begin as it should" in str(log.damage[0])


def test_an_empty_log_has_no_image_topic(tmp_path: Path) -> None:
    path = tmp_path / "empty.mcap"
    path.write_bytes(b"\x89MCAP0\r\n")
    with open_log(path) as log, pytest.raises(LogError, match="no image topic"):
        log.select()


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


def test_a_definition_that_does_not_add_up_costs_what_it_defines(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    small_log(path, "uncompressed")
    data = path.read_bytes()
    topic_length = data.index(b"\x07\0\0\0/camera")
    changed(path, topic_length, b"\xff\xff")
    with open_log(path, keep_corrupt=True) as log:
        log.verify()
        assert any("used all the same" in loss for loss in log.losses)
        assert len(list(log.frames(log.select()))) == FRAMES
