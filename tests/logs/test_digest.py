"""What tells one log from another without reading it, and reading all of it."""

import hashlib
import shutil
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from roadeval.logs import log
from roadeval.logs.container import file, records
from roadeval.logs.container.records import FileBytes
from roadeval.logs.log import describe, open_log

CHUNK = 100_000
FRAMES = 40


def write(
    path: Path, *, size: int = CHUNK, frames: int = FRAMES, chunks=True, crcs=True, seed: int = 0
) -> Path:
    """Write a log of noise, a chunk each message, with data that a checksum alone can tell."""
    noise = np.random.default_rng(seed)
    options = {"chunk_size": size, "compression": CompressionType.NONE}
    with path.open("wb") as file:
        writer = Writer(file, **options, use_chunking=chunks, enable_crcs=crcs)
        writer.start()
        schema = writer.register_schema("Noise", "ros2msg", b"uint8[] data")
        channel = writer.register_channel("/noise", "cdr", schema)
        for number in range(frames):
            writer.add_message(channel, number * 10**8, noise.bytes(size), number * 10**8)
        writer.finish()
    return path


def digest(path: Path) -> str:
    with open_log(path) as opened:
        return opened.digest


@pytest.fixture
def noise(tmp_path):
    return write(tmp_path / "noise.mcap")


@pytest.mark.parametrize("kind", [{}, {"crcs": False}, {"chunks": False}])
def test_a_log_has_one_digest_wherever_it_lies_and_another_log_another(tmp_path, kind):
    first = write(tmp_path / "a.mcap", **kind)
    (tmp_path / "there").mkdir()
    assert digest(shutil.copy(first, tmp_path / "there" / "b.mcap")) == digest(first)
    if kind.get("chunks", True):
        assert digest(write(tmp_path / "c.mcap", seed=1, **kind)) != digest(first)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(first.read_bytes()[: -2 * CHUNK])
    assert digest(cut) != digest(first)


def test_the_digest_of_a_folder_is_that_of_its_files_in_order(tmp_path):
    digests = []
    for seeds in ((0, 1), (1, 0)):
        folder = tmp_path / str(seeds)
        folder.mkdir()
        for place, seed in enumerate(seeds):
            write(folder / f"log_{place}.mcap", seed=seed)
        digests.append(digest(folder))
    assert digests[0] != digests[1]


def test_a_byte_that_changed_inside_a_chunk_is_found_by_verifying(noise, tmp_path):
    content = bytearray(noise.read_bytes())
    content[len(content) // 2] ^= 0xFF
    other = tmp_path / "other.mcap"
    other.write_bytes(content)
    assert digest(other) == digest(noise)
    whole, damaged = describe(noise, verify=True), describe(other, verify=True)
    assert whole.sha256 == hashlib.sha256(noise.read_bytes()).hexdigest()
    assert damaged.sha256 == hashlib.sha256(other.read_bytes()).hexdigest()
    assert not whole.losses
    assert damaged.losses


def test_of_a_large_log_the_messages_are_not_read_unless_asked(noise, monkeypatch):
    read = []

    class Counted(FileBytes):
        def __getitem__(self, part):
            found = super().__getitem__(part)
            read.append(len(found))
            return found

    for module in (records, file):
        monkeypatch.setattr(module, "FileBytes", Counted)
    monkeypatch.setattr(log, "SMALL", CHUNK)
    found = describe(noise)
    assert (found.verified, found.sha256) == (False, None)
    assert [topic.count for topic in found.topics] == [FRAMES]
    assert sum(read) < noise.stat().st_size / 4
    steps = []
    assert describe(noise, verify=True, on_bytes=lambda *step: steps.append(step)).verified
    done, total = steps[-1]
    assert total == 2 * noise.stat().st_size
    assert 0.9 * total < done <= total
    assert [one for one, _ in steps] == sorted(one for one, _ in steps)
