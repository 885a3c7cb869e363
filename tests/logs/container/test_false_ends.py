"""A file whose end says other things than what lies before it, or whose chunks do not add up."""

from pathlib import Path

import pytest
from mcap.opcode import Opcode

from roadeval.logs.log import Log, open_log
from tests.fixtures import broken
from tests.fixtures.broken import HEAD, chunk, data_end, good, length_of, mended, over, records

LENGTH_AT = HEAD + 8 + 8 + 8
"""Where a chunk index has the length of its chunk."""


def opened(folder: Path, data: bytes) -> Log:
    path = folder / "drive.mcap"
    path.write_bytes(data)
    return open_log(path)


def losses(folder: Path, data: bytes) -> str:
    with opened(folder, data) as log:
        log.verify()
        return " | ".join(log.losses)


def without(number: int, data: bytes) -> bytes:
    """Leave a chunk out."""
    at = chunk(number, data)
    return data[:at] + data[at + length_of(data, at) :]


@pytest.mark.parametrize("length", [0, 1, 1 << 62])
def test_an_index_of_a_chunk_that_cannot_be_so_long_is_not_followed(tmp_path, length):
    """One of no length would lead back to its own chunk, again and again."""
    data = good()
    at = next(records(data, Opcode.CHUNK_INDEX))
    data = mended(over(data, at + LENGTH_AT, length.to_bytes(8, "little")))
    with opened(tmp_path, data) as log:
        assert log.topics[0].count == broken.FRAMES


def test_a_chunk_that_is_left_out_is_told_though_all_others_are_sound(tmp_path):
    data = good()
    missing = length_of(data, chunk(3, data))
    told = losses(tmp_path, without(3, data))
    assert f"{missing} bytes are missing before it" in told


def test_a_chunk_that_is_there_twice_is_told(tmp_path):
    data = good()
    at = chunk(3, data)
    more = length_of(data, at)
    assert f"{more} bytes too many lie before it" in losses(
        tmp_path, data[: at + more] + data[at : at + more] + data[at + more :]
    )


def test_without_an_end_the_counts_behind_the_data_tell_what_is_missing(tmp_path):
    told = losses(tmp_path, without(3, good())[:-20])
    assert "lost: 2 of /cam/image/compressed" in told


def test_without_a_summary_a_wrong_checksum_of_all_data_is_a_loss(tmp_path):
    data = broken.log(enable_data_crcs=True).bytes()
    end = data_end(data)
    damaged = without(3, data[: end + length_of(data, end)])
    assert "nothing tells which messages are wrong or missing" in losses(tmp_path, damaged)


def test_a_chunk_whose_records_do_not_add_up_is_told_though_its_checksum_is_right(tmp_path):
    data = broken.log(use_statistics=False, compression=broken.CompressionType.NONE).bytes()
    at = chunk(3, data)
    inside = next(at for at in broken.inside(data, at) if data[at] == Opcode.MESSAGE)
    damaged = mended(over(data, inside + broken.LENGTH_AT, broken.ABSURD))
    assert "records do not add up" in losses(tmp_path, damaged)
