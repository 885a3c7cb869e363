"""How long rows wait, and that few chunks come of many frames."""

import pytest

from roadeval.recording.rows import (
    CHUNK_BYTES,
    IMAGES_AND_TEXT,
    NUMBERS,
    Batcher,
    WaitLimits,
    numbers,
    states,
    texts,
)

WAIT = WaitLimits(8, 64)


def rows_of(pending):
    return pending.chunk().to_record_batch().column("frame").to_pylist()


def run(frames, rows, limits=WAIT):
    """Feed frames, each a row of ``rows(frame)`` by path; yield what is due, and after which."""
    batcher = Batcher(limits)
    for frame in range(frames):
        for path, columns, value in rows(frame):
            batcher[path, columns].add((frame, frame, frame), value)
        for key in batcher.end_frame():
            yield frame, key[0], rows_of(batcher[key])
            del batcher[key]
    for key in batcher:
        yield frames, key[0], rows_of(batcher[key])


def test_every_row_comes_once_and_in_order_and_waits_no_longer_than_it_may():
    ended = list(run(1000, lambda frame: [("/a", numbers, (frame,))]))
    assert [row for *_, rows in ended for row in rows] == list(range(1000))
    for after, _, rows in ended[:-1]:
        assert after - rows[0] + 1 == WAIT.after(after + 1)


def test_an_entity_is_full_by_its_bytes_and_others_wait_on():
    half = "x" * (CHUNK_BYTES // 2)
    ended = list(run(8, lambda _: [("/large", texts, half), ("/small", texts, "x")]))
    assert [rows for _, path, rows in ended if path == "/large"] == [[0, 1], [2, 3], [4, 5], [6, 7]]
    assert [rows for _, path, rows in ended if path == "/small"] == [list(range(8))]


@pytest.mark.parametrize(("limits", "most"), [(IMAGES_AND_TEXT, 320), (NUMBERS, 70)])
def test_an_hour_of_small_rows_makes_few_chunks(limits, most):
    ended = list(run(36_000, lambda _: [("/a", states, "on")], limits))
    assert sum(len(rows) for *_, rows in ended) == 36_000
    assert len(ended) < most
