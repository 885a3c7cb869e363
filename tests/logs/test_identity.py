"""The identity of a log's file: by its checksums where they cover it, else there is none."""

from io import BytesIO

import pytest
from mcap.writer import CompressionType, IndexType, Writer

from roadeval.logs import identity_of

CHUNK = 50_000


def log(text=b"a", *, at=7, compression=CompressionType.NONE, **options):
    """A log of twenty messages in five chunks, one of which is of another letter."""
    file = BytesIO()
    writer = Writer(file, chunk_size=CHUNK, compression=compression, **options)
    writer.start()
    channel = writer.register_channel("/topic", "raw", 0)
    for number in range(20):
        data = (text if number == at else b"x") * (CHUNK // 4)
        writer.add_message(channel, number, data, number)
    writer.add_attachment(1, 1, "notes", "text/plain", text if at is None else b"x")
    writer.finish()
    return file


class Counted(BytesIO):
    """A file that counts the bytes that are read."""

    taken = 0

    def read(self, size=-1):
        data = super().read(size)
        self.taken += len(data)
        return data


def test_the_same_content_has_the_same_identity():
    assert identity_of(log()) == identity_of(log()) is not None


@pytest.mark.parametrize("at", [0, 19, None])
def test_other_content_of_the_same_size_has_another(at):
    one, other = log(b"a", at=at), log(b"b", at=at)
    assert len(one.getvalue()) == len(other.getvalue())
    assert identity_of(one) != identity_of(other)


def test_what_the_chunks_hold_is_not_read():
    file = Counted(log().getvalue())
    assert identity_of(file)
    assert file.taken < len(file.getvalue()) // 20


def damaged(file, place):
    content = bytearray(file.getvalue())
    content[place] ^= 1
    return BytesIO(bytes(content))


@pytest.mark.parametrize(
    "file",
    [
        log(enable_crcs=False),
        log(use_chunking=False),
        log(index_types=IndexType.NONE),
        damaged(log(), -60),
        BytesIO(log().getvalue()[:-1]),
        BytesIO(b"no log at all, but of some length to look at"),
        BytesIO(),
    ],
    ids=["no checksums", "no chunks", "no index", "summary", "end", "no log", "empty"],
)
def test_where_no_checksum_tells_there_is_none(file):
    assert identity_of(file) is None
