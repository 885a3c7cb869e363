"""The walk from record to record, over what is damaged."""

from pathlib import Path

import pytest

from roadeval.logs import LogError, TopicSettings, open_log
from tests.logs.making import CAMERA, FRAMES, small_log

MESSAGE = b"\x05"
INDEX = b"\x07"
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
