"""Payloads are read ahead, in few passes and little memory."""

import weakref
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest

from roadeval.recording import Recording, RecordingError
from roadeval.recording.read.payloads import Page, around
from roadeval.recording.read.rrd_file import RrdFile


@pytest.mark.parametrize("read_ahead", [8 << 20, 0])
def test_every_frame_comes_back_in_any_order(drive, recording, read_ahead, monkeypatch):
    monkeypatch.setattr("roadeval.recording.read.payloads.READ_AHEAD", read_ahead)
    again = Recording(recording.path)
    for each in (*drive[9:], *reversed(drive)):
        np.testing.assert_array_equal(again.truth(each.frame.number), each.frame.truth)


def test_an_entity_is_gone_through_once_whatever_frames_are_read(drive, recording, monkeypatch):
    again, passes, batches = Recording(recording.path), [], RrdFile.batches

    def counted(*given, **words):
        passes.append(given)
        return batches(*given, **words)

    monkeypatch.setattr(RrdFile, "batches", counted)
    for each in (drive[-1], *drive):
        again.layer("filtered", "post", each.frame.number)
    with pytest.raises(RecordingError, match="nothing on frame 99"):
        again.layer("filtered", "post", 99)
    assert len(passes) == 1


def pages_of(sizes):
    """Pages of one frame each, of these many bytes, and the most of them that lived at once."""
    made, most = [], [0]

    def pages():
        for number, size in enumerate(sizes):
            blobs = pa.array([[0] * size], pa.list_(pa.uint8()))
            made.append(weakref.ref(blobs))
            most[0] = max(most[0], sum(each() is not None for each in made))
            yield Page([number], blobs)
            del blobs

    return pages(), most


def test_no_more_of_an_entity_is_held_than_is_read_ahead(monkeypatch):
    monkeypatch.setattr("roadeval.recording.read.payloads.READ_AHEAD", 500)
    pages, most = pages_of([100] * 60)
    there, payloads = around(30, pages)
    assert len(there) == 60
    assert 30 in payloads
    assert most[0] <= 7


@pytest.mark.parametrize(
    ("frame", "sizes", "kept"),
    [
        (2, [10] * 9, [2, 3, 4, 5]),
        (8, [10] * 9, [5, 6, 7, 8]),
        (7, [10] * 9, [5, 6, 7, 8]),
        (1, [10, 99, 10, 10], [1]),
        (3, [10, 10, 99, 10], [3]),
        (99, [10] * 3, [0, 1, 2]),
    ],
)
def test_the_frames_after_one_are_kept_first_then_the_nearest_before(
    frame, sizes, kept, monkeypatch
):
    one = pa.array([[0] * 10], pa.list_(pa.uint8())).nbytes
    monkeypatch.setattr("roadeval.recording.read.payloads.READ_AHEAD", 4 * one)
    assert list(around(frame, pages_of(sizes)[0])[1]) == kept


def test_rows_that_were_put_together_with_others_may_have_no_list_at_all(recording, monkeypatch):
    batch = pa.RecordBatch.from_pydict(
        {"frame": [1, 2, 3, 4], "Scalars:scalars": pa.array([[0.5], None, [], [0.25]])}
    )
    chunk = SimpleNamespace(to_record_batch=lambda: batch)
    stream = SimpleNamespace(filter=lambda **given: [chunk])
    again = Recording(recording.path)
    monkeypatch.setattr(RrdFile, "stream", lambda _: stream)
    assert again.scalars("/metrics/filtered/post/ERR").to_dict() == {1: 0.5, 4: 0.25}
    batch = batch.slice(0, 2)
    assert again.scalars("/metrics/filtered/post/ERR").to_dict() == {1: 0.5}
