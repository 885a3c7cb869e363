"""Which frames' pictures are kept, and where they wait until that is known."""

import sqlite3
import tracemalloc
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from roadeval.recording import Keeper, Recorder, Recording, RecordingError, Rule
from roadeval.recording.write.keeping import Kept
from roadeval.recording.write.shelf import Shelf
from tests.recording.making import layout, result, rows_of

RESULTS = {"summary": "{}"}
ERRORS = [0.1, 0.5, 0.3, 0.5, 0.2, 0.4, 0.0]


def write(keeper):
    for number, err in enumerate(ERRORS):
        keeper.write(keeper.encode(result(number, err=err), number))


def keep(path, rule):
    """Record frames of these ERR by a rule."""
    with Keeper(path, layout(), Rule.parse(rule)) as keeper:
        write(keeper)
        keeper.finish(RESULTS)
    return Recording(path)


def encoded_of(folder):
    """A frame as it is put aside."""
    with Keeper(folder / "out.rrd", layout(), Rule.parse("worst:2")) as keeper:
        return keeper.encode(result(0), 0).encoded


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(
    ("rule", "frames"),
    [("worst:1", [1]), ("worst:2", [1, 3]), ("worst:4", [1, 2, 3, 5]), ("worst:99", range(7))],
)
def test_the_worst_frames_pictures_are_kept_and_of_equals_the_earlier(rule, frames, tmp_path):
    recording = keep(tmp_path / "out.rrd", rule)
    assert list(recording.frame_numbers) == list(frames)
    assert list(recording.frames.frame) == list(range(7))
    for number in frames:
        mask = next(result(number).variants[0].masks())[1].pixels()
        np.testing.assert_array_equal(recording.layer("filtered", "post", number), mask)


def test_settled_pictures_are_the_worst(tmp_path):
    with Keeper(tmp_path / "out.rrd", layout(), Rule.parse("worst:2")) as keeper:
        write(keeper)
        keeper.settle()
        assert set(Recording(keeper.partial).frame_numbers) == {1, 3}
        keeper.finish(RESULTS)
    assert list(Recording(keeper.path).frame_numbers) == [1, 3]


def test_pictures_wait_in_a_file_that_is_gone_at_the_end(tmp_path):
    with Keeper(tmp_path / "out.rrd", layout(), Rule.parse("worst:3")) as keeper:
        assert names(tmp_path) == ["out.partial.rrd"]
        write(keeper)
        assert names(tmp_path) == ["out.partial.pictures", "out.partial.rrd"]
        keeper.finish(RESULTS)
    assert names(tmp_path) == ["out.rrd"]


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit, ValueError])
def test_a_run_that_is_stopped_keeps_the_worst_so_far(stop, tmp_path):
    def stopped(keeper):
        with keeper:
            write(keeper)
            raise stop

    with pytest.raises(stop):
        stopped(Keeper(tmp_path / "out.rrd", layout(), Rule.parse("worst:3")))
    assert names(tmp_path) == ["out.partial.rrd"]
    partial = Recording(tmp_path / "out.partial.rrd")
    assert not partial.complete
    assert partial.frame_numbers == (1, 3, 5)


@pytest.mark.parametrize("at", [1, 2, 3])
@pytest.mark.parametrize("owner", [(Shelf, "get"), (Recorder, "_turn")])
def test_who_stops_a_run_while_the_worst_are_written_keeps_the_rest_of_them(
    owner, at, tmp_path, monkeypatch
):
    calls = []
    usual = getattr(*owner)

    def interrupted(*given):
        calls.append(given)
        if len(calls) == at:
            raise KeyboardInterrupt
        return usual(*given)

    def stopped(keeper):
        with keeper:
            write(keeper)
            monkeypatch.setattr(*owner, interrupted)
            keeper.finish(RESULTS)

    with pytest.raises(KeyboardInterrupt):
        stopped(Keeper(tmp_path / "out.rrd", layout(), Rule.parse("worst:3")))
    assert names(tmp_path) == ["out.partial.rrd"]
    partial = Recording(tmp_path / "out.partial.rrd")
    assert partial.frame_numbers == (1, 3, 5)
    shown = rows_of(partial, "/filtered/post", "EncodedImage:blob")
    assert shown == {1: 1, 2: 0, 3: 1, 4: 0, 5: 1, 6: 0}


def test_a_waiting_file_that_cannot_be_removed_does_not_keep_the_recording_open(
    tmp_path, monkeypatch
):
    def fail(self):
        raise RecordingError("out.partial.pictures: cannot be written")

    def stopped(keeper, stop):
        with keeper:
            write(keeper)
            raise stop

    monkeypatch.setattr(Shelf, "close", fail)
    for stop in (KeyboardInterrupt, SystemExit):
        # What went wrong first is what the user hears.
        with pytest.raises(stop):
            stopped(Keeper(tmp_path / "out.rrd", layout(), Rule.parse("worst:3")), stop)
        assert Recording(tmp_path / "out.partial.rrd").frame_numbers == (1, 3, 5)
        assert list(Recording(tmp_path / "out.partial.rrd").frames.frame) == list(range(7))
    with pytest.raises(RecordingError, match="cannot be written"):
        keep(tmp_path / "out.rrd", "worst:3")
    assert Recording(tmp_path / "out.rrd").complete


@pytest.mark.parametrize("error", [OSError(5, "Input/output error"), sqlite3.OperationalError()])
def test_a_waiting_file_that_cannot_be_closed_is_one_line(error, tmp_path):
    shelf = Shelf(tmp_path / "out.partial.pictures")
    shelf.put(encoded_of(tmp_path))
    shelf._file.close()
    shelf._file = Mock(close=Mock(side_effect=error))
    with pytest.raises(RecordingError, match=r"^.*/out\.partial\.pictures: .*$"):
        shelf.close()
    assert not shelf._path.exists()


def test_a_frame_whose_pictures_were_lost_is_one_line(tmp_path):
    shelf = Shelf(tmp_path / "out.partial.pictures")
    with pytest.raises(RecordingError, match=r"pictures: the pictures of frame 7 are lost"):
        shelf.get(7)
    shelf.close()


@pytest.mark.parametrize("rule", ["all", "masks", "every:2", "worst:1"])
def test_what_a_killed_run_left_goes_whatever_the_next_ones_rule(rule, tmp_path):
    (tmp_path / "out.partial.pictures").write_bytes(b"whatever")
    keep(tmp_path / "out.rrd", rule)
    assert names(tmp_path) == ["out.rrd"]


def test_a_name_that_is_too_long_for_the_waiting_file_alone_will_do_where_none_waits(tmp_path):
    path = tmp_path / f"{240 * 'a'}.rrd"
    assert keep(path, "all").complete


def test_what_a_killed_run_left_is_replaced(tmp_path):
    left = tmp_path / "out.partial.pictures"
    left.write_bytes(b"whatever")
    assert keep(tmp_path / "out.rrd", "worst:2").frame_numbers == (1, 3)
    assert names(tmp_path) == ["out.rrd"]


def test_memory_holds_few_pictures_however_many_are_kept(tmp_path):
    size, count = 1 << 20, 40
    with Keeper(tmp_path / "out.rrd", layout(), Rule.parse("worst:40")) as keeper:
        plain = keeper.encode(result(0), 0).encoded
        tracemalloc.start()
        for number in range(count):
            large = {path: payload.ljust(size, b"0") for path, payload in plain.payloads.items()}
            keeper.write(Kept(replace(plain, number=number, payloads=large), 0.5))
        del large
        held, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert held < 2 * size * len(plain.payloads)


def test_the_room_of_frames_that_are_dropped_is_used_again(tmp_path):
    with Keeper(tmp_path / "out.rrd", layout(), Rule.parse("worst:2")) as keeper:
        plain = keeper.encode(result(0), 0).encoded
        for number in range(50):
            large = replace(plain, number=number, payloads={"/camera": bytes(1 << 20)})
            keeper.write(Kept(large, number / 50))
        assert (tmp_path / "out.partial.pictures").stat().st_size < 5 << 20


def test_a_file_that_cannot_be_written_is_one_line(tmp_path):
    shelf, encoded = Shelf(tmp_path / "missing" / "out.partial.pictures"), encoded_of(tmp_path)
    with pytest.raises(
        RecordingError, match=r"out\.partial\.pictures: cannot be written"
    ) as caught:
        shelf.put(encoded)
    assert "\n" not in str(caught.value)


def test_a_disk_that_fills_up_ends_the_run_with_one_line_and_a_readable_part(tmp_path, monkeypatch):
    def fail(self, encoded):
        raise RecordingError("the disk is full")

    def fill(keeper):
        with keeper:
            keeper.write(keeper.encode(result(0), 0))
            monkeypatch.setattr(Shelf, "put", fail)
            keeper.write(keeper.encode(result(1), 1))

    keeper = Keeper(tmp_path / "out.rrd", layout(), Rule.parse("worst:3"))
    with pytest.raises(RecordingError, match="the disk is full"):
        fill(keeper)
    assert Recording(keeper.partial).frame_numbers == (0,)
