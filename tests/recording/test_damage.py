"""A recording damaged inside: what is read is what was written, or one line says where it is not.

The tiny recording is damaged at random places. Much of that still unpacks; check sums find it.
"""

import random
from hashlib import sha256

import numpy as np
import pytest

from roadeval.errors import RoadevalError
from roadeval.recording import DamagedError, Recording, RecordingError, rrd_file
from roadeval.recording import layout as at
from roadeval.recording.rrd_file import RrdFile, _places

MUTATIONS = 120
HEADER = 16
"""Bytes before a message."""


def damaged(whole, draw):
    """The bytes of a file with a bit turned, or a few bytes zeroed, random, gone or twice there."""
    data, place = bytearray(whole), draw.randrange(len(whole))
    match draw.randrange(6):
        case 0:
            data[place : place + 16] = bytes(len(data[place : place + 16]))
        case 1:
            data[place : place + 8] = draw.randbytes(len(data[place : place + 8]))
        case 2:
            del data[place : place + draw.choice((1, 64))]
        case 3:
            data[place:place] = data[place : place + draw.choice((1, 64))]
        case _:
            data[place] ^= 1 << draw.randrange(8)
    return bytes(data)


def parts(recording):
    """Everything that is read of a recording, a function each."""
    yield "summary", lambda: recording.summary
    yield "roles", lambda: recording.roles
    yield "timing", lambda: recording.scalars("/timing/filtered/post").to_csv()
    yield "notes", lambda: [recording.notes(frame) for frame in range(20)]
    for table in ("frames", "windows"):
        yield table, lambda table=table: recording.table(table).to_csv()
    for name in ("ndi", "rings", "post", "errors"):
        yield name, lambda name=name: recording.layer("filtered", name, 4).tobytes()
    yield "image", lambda: sha256(np.ascontiguousarray(recording.image(4))).digest()
    yield "truth", lambda: recording.truth(4).tobytes()


def told(read):
    """What reading gives, or that it says what is wrong."""
    try:
        return read()
    except RoadevalError:
        return None


def test_nothing_else_is_ever_read_without_a_word(recording, tmp_path):
    intact = {name: read() for name, read in parts(recording)}
    whole, path, draw = recording.path.read_bytes(), tmp_path / "out.rrd", random.Random(0)
    seen = 0
    for _ in range(MUTATIONS):
        path.write_bytes(damaged(whole, draw))
        opened = told(lambda: Recording(path))
        if opened is None or not told(lambda opened=opened: opened.complete):
            continue
        seen += 1
        for name, read in parts(opened):
            assert told(read) in (None, intact[name])
    assert seen > MUTATIONS // 10


def place_of(path, recording):
    """Where the first message of an entity lies, of frames if there are any."""
    places = _places(RrdFile(recording.path)._store)[path]
    return min(places, key=lambda place: (place.static, place.offset))


@pytest.fixture
def spoilt(recording, tmp_path):
    """Turn a bit in the middle of an entity's first message; returns the recording's path."""

    def spoilt(path):
        place, data = place_of(path, recording), bytearray(recording.path.read_bytes())
        data[place.offset + place.size // 2] ^= 1
        (tmp_path / "out.rrd").write_bytes(data)
        return tmp_path / "out.rrd"

    return spoilt


@pytest.mark.parametrize("path", [at.LAYOUT, at.PROPERTIES, at.SUMS])
def test_a_recording_cannot_be_opened_where_what_it_is_is_damaged(path, spoilt):
    with pytest.raises(DamagedError, match=f"damaged inside, at {path}; make it again"):
        Recording(spoilt(path))


@pytest.mark.parametrize(
    ("path", "read"),
    [
        ("/truth", lambda opened: opened.truth(4)),
        ("/filtered/ndi", lambda opened: opened.layer("filtered", "ndi", 4)),
        (at.NOTES, lambda opened: opened.notes(3)),
        ("/results/frames", lambda opened: opened.frames),
        ("/results/summary", lambda opened: opened.summary),
        ("/timing/filtered/post", lambda opened: opened.scalars("/timing/filtered/post")),
        (at.CAMERA, lambda opened: opened.image(4)),
        (at.SHOWN, lambda opened: opened.frame_numbers),
    ],
)
def test_each_part_is_checked_when_it_is_read(path, read, spoilt):
    opened = Recording(spoilt(path))
    for _ in range(2):
        with pytest.raises(DamagedError, match=f"at {path}"):
            read(opened)


def test_a_part_is_checked_once(recording, monkeypatch):
    opened, checked = Recording(recording.path), []
    monkeypatch.setattr(rrd_file, "crc32", lambda message: checked.append(message) or 0)
    monkeypatch.setattr(opened._file, "_sums", dict.fromkeys(opened._file._sums, 0))
    for frame in (4, 5, 18):
        opened.truth(frame)
    assert len(checked) == len({*checked}) > 0


def test_without_check_sums_another_process_tries_the_file_first(recording, tmp_path, monkeypatch):
    whole = recording.path.read_bytes()
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(whole[: place_of(at.SUMS, recording).offset - HEADER])
    assert not Recording(cut).complete
    assert Recording(cut).frame_numbers == recording.frame_numbers
    monkeypatch.setattr(rrd_file, "_PROBE", "import os; os.abort()")
    with pytest.raises(DamagedError, match="at a place beyond which Rerun cannot read"):
        Recording(cut)
    assert Recording(recording.path).truth(4).shape == recording.truth(4).shape


def test_a_module_beside_a_recording_is_not_run(recording, tmp_path, monkeypatch):
    (tmp_path / "rerun.py").write_text("import os; os.abort()")
    monkeypatch.chdir(tmp_path)
    assert rrd_file.can_be_read(recording.path)


def test_a_name_that_is_not_utf8_is_refused(recording, tmp_path):
    path = tmp_path / "caf\udce9.rrd"
    path.write_bytes(recording.path.read_bytes())
    with pytest.raises(RecordingError, match="not UTF-8: rename it"):
        Recording(path)


def test_a_message_that_claims_a_size_that_cannot_be_is_not_unpacked():
    """Fields 2, 3 and 5 of Protocol Buffers: LZ4, a size of a TiB, and one byte of content."""
    claimed = bytes((0x10, 2, 0x18, *(0x80,) * 5, 0x20, 0x2A, 1, 0))
    with pytest.raises(ValueError, match="cannot be"):
        rrd_file.unpacked(claimed)
