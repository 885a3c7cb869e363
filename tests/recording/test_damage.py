"""A recording damaged inside: what is read is what was written, or one line says where it is not.

The tiny recording is damaged at random places. Much of that still unpacks.
"""

import random
from hashlib import sha256

import numpy as np
import pytest

from roadeval import Recording, RoadevalError
from roadeval.recording import layout as at
from roadeval.recording.layout import DamagedError
from roadeval.recording.rrd_file import ALWAYS

MUTATIONS = 120
CHECKED = ("post", "errors", "truth")
"""PNG files, which have checksums of their own."""


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


def test_what_is_read_of_it_has_its_own_checksum_or_one_line_says_where_it_is_not(
    recording, tmp_path
):
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
            found = told(read)
            assert name not in CHECKED or found in (None, intact[name])
    assert seen > MUTATIONS // 10


def place_of(path, recording):
    """Where the first message of an entity lies, of frames if there are any."""
    places = recording._file.messages[path]
    return min(places, key=lambda place: (place.span == ALWAYS, place.offset))


@pytest.fixture
def spoilt(recording, tmp_path):
    """Zero an entity's first message; returns the recording's path."""

    def spoilt(path):
        place, data = place_of(path, recording), bytearray(recording.path.read_bytes())
        data[place.offset : place.offset + place.size] = bytes(place.size)
        (tmp_path / "out.rrd").write_bytes(data)
        return tmp_path / "out.rrd"

    return spoilt


@pytest.mark.parametrize("path", [at.LAYOUT, at.PROPERTIES])
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


def test_a_message_that_its_index_says_is_larger_than_the_file_takes_no_memory(recording):
    opened = Recording(recording.path)
    places = opened._file.messages["/truth"]
    opened._file.messages["/truth"] = [each._replace(size=1 << 62) for each in places]
    with pytest.raises(DamagedError, match="at /truth"):
        opened.truth(4)


def test_a_message_of_another_entity_is_not_taken_for_one(recording, tmp_path):
    data, truth, post = (
        recording.path.read_bytes(),
        *(place_of(path, recording) for path in ("/truth", "/filtered/post")),
    )
    moved = bytearray(data)
    moved[truth.offset : truth.offset + post.size] = data[post.offset : post.offset + post.size]
    (tmp_path / "out.rrd").write_bytes(moved)
    with pytest.raises(DamagedError, match="at /truth"):
        Recording(tmp_path / "out.rrd").truth(4)
