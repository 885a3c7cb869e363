"""A file whose end says other things than what lies before it, or whose chunks do not add up."""

import pytest
from mcap.opcode import Opcode

from roadeval.logs.log import open_log
from tests.fixtures import broken
from tests.fixtures.broken import HEAD, chunk, data_end, good, length_of, mended, over, records

LENGTH_AT = HEAD + 8 + 8 + 8
"""The offset of the chunk's length in a chunk index."""


def without(number: int, data: bytes) -> bytes:
    """Leave a chunk out."""
    at = chunk(number, data)
    return data[:at] + data[at + length_of(data, at) :]


@pytest.mark.parametrize("length", [0, 1, 1 << 62])
def test_an_index_of_a_chunk_that_cannot_be_so_long_is_not_followed(tmp_path, length):
    """One of no length would lead back to its own chunk, again and again."""
    data = good()
    at = next(records(data, Opcode.CHUNK_INDEX))
    path = tmp_path / "drive.mcap"
    path.write_bytes(mended(over(data, at + LENGTH_AT, length.to_bytes(8, "little"))))
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
    data, loss = damage()
    path = tmp_path / "drive.mcap"
    path.write_bytes(data)
    with open_log(path) as log:
        log.verify()
        assert loss in " | ".join(log.losses)
