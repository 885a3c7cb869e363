"""Chunks that are intact are read, whatever is damaged beside them, and nothing unverified is."""

from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.opcode import Opcode

from tests.fixtures.broken import HEAD, data_end, length_of, mended, over, records
from tests.fuzz.intact import FRAMES, Intact, Reading, intact_logs, read

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
