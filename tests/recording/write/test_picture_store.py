"""Images of frames put aside on the disk."""

import pytest

from roadeval.recording import EncodedFrame, RecordingError
from roadeval.recording.write.picture_store import PictureStore

PAYLOADS = {"/camera": b"jpeg", "/filtered/post": b""}
ONE_LINE = r"^.*/images: the images put aside cannot be written or read \(.*\); is the disk full\?$"


@pytest.fixture
def store(tmp_path):
    return PictureStore(tmp_path / "images")


def test_a_frame_comes_back_with_its_images_alone(store):
    store.put(EncodedFrame(7, 70, PAYLOADS, scalars={"/metrics": 0.5}))
    back = store.get(7)
    assert (back.number, back.stamp_ns, back.payloads) == (7, 70, PAYLOADS)
    assert list(back.payloads) == list(PAYLOADS)
    assert not back.scalars


def test_nothing_is_left_when_it_is_cleared(store, tmp_path):
    store.clear()
    for number in (1, 2):
        store.put(EncodedFrame(number, number, PAYLOADS))
    store.drop(1)
    assert [path.name for path in (tmp_path / "images").iterdir()] == ["2"]
    store.clear()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("content", [None, b"whatever"])
def test_images_that_were_lost_or_damaged_are_one_line(content, store, tmp_path):
    store.put(EncodedFrame(7, 70, PAYLOADS))
    path = tmp_path / "images" / "7"
    path.unlink() if content is None else path.write_bytes(content)
    with pytest.raises(RecordingError, match=ONE_LINE):
        store.get(7)


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    store = PictureStore(tmp_path / "missing" / "images")
    with pytest.raises(RecordingError, match=ONE_LINE):
        store.put(EncodedFrame(7, 70, PAYLOADS))
