"""Which frames' images are kept by a rule, whatever ends the run."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from roadeval.data import Doubt
from roadeval.recording import EncodedFrame, Recorder, Recording, RecordingError, RecordRule
from roadeval.recording.recorder import WorstFrames
from tests.recording.making import RESULTS, layout, result, rows_of
from tests.results.making import lines

ERRORS = [0.1, 0.5, 0.3, 0.5, 0.2, 0.4, 0.0]


def selective(path, rule):
    return Recorder(path, layout(), RecordRule.parse(rule))


def write(recorder):
    for number, err in enumerate(ERRORS):
        each = result(number, err=err)
        recorder.write(recorder.encode(each, number), lines(each))


def keep(path, rule):
    """Record frames of these ERR by a rule."""
    with selective(path, rule) as recorder:
        write(recorder)
        recorder.finish(RESULTS)
    return Recording(path)


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


def test_without_truth_the_most_doubtful_frames_are_kept(tmp_path):
    rule, without = RecordRule.parse("worst:2"), replace(layout(), has_truth=False)
    with Recorder(tmp_path / "out.rrd", without, rule) as recorder:
        for number, entropy in enumerate([0.1, 0.4, 0.2, 0.3]):
            doubts = (Doubt("filtered", "post", entropy), Doubt("unfiltered", "post", 1 - entropy))
            each = replace(result(number), tallies=(), errors={}, doubts=doubts)
            each = replace(each, frame=replace(each.frame, truth=None))
            recorder.write(recorder.encode(each, number))
        recorder.finish(RESULTS)
    assert list(Recording(recorder.path).frame_numbers) == [1, 3]


def test_flushed_pictures_are_the_worst(tmp_path):
    with selective(tmp_path / "out.rrd", "worst:2") as recorder:
        write(recorder)
        recorder.flush()
        assert set(Recording(recorder.partial).frame_numbers) == {1, 3}
        recorder.finish(RESULTS)
    assert list(Recording(recorder.path).frame_numbers) == [1, 3]


def test_images_wait_in_a_folder_that_is_gone_at_the_end(tmp_path):
    with selective(tmp_path / "out.rrd", "worst:3") as recorder:
        partial = recorder.partial.name
        assert names(tmp_path) == [partial]
        write(recorder)
        assert names(tmp_path) == [partial, f"{partial}-images"]
        recorder.finish(RESULTS)
    assert names(tmp_path) == ["out.rrd"]


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit, ValueError])
def test_a_run_that_is_stopped_keeps_the_worst_so_far(stop, tmp_path):
    def stopped(recorder):
        with recorder:
            write(recorder)
            raise stop

    recorder = selective(tmp_path / "out.rrd", "worst:3")
    with pytest.raises(stop):
        stopped(recorder)
    assert names(tmp_path) == [recorder.partial.name]
    partial = Recording(recorder.partial)
    assert not partial.complete
    assert partial.frame_numbers == (1, 3, 5)


@pytest.mark.parametrize("at", [1, 2, 3])
@pytest.mark.parametrize("owner", [(WorstFrames, "_read"), (Recorder, "_end_frame")])
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

    def stopped(recorder):
        with recorder:
            write(recorder)
            monkeypatch.setattr(*owner, interrupted)
            recorder.finish(RESULTS)

    recorder = selective(tmp_path / "out.rrd", "worst:3")
    with pytest.raises(KeyboardInterrupt):
        stopped(recorder)
    assert names(tmp_path) == [recorder.partial.name]
    partial = Recording(recorder.partial)
    assert partial.frame_numbers == (1, 3, 5)
    shown = rows_of(partial, "/filtered/post", "EncodedImage:blob")
    assert shown == {1: 1, 2: 0, 3: 1, 4: 0, 5: 1, 6: 0}


def test_a_name_that_is_too_long_for_the_folder_alone_will_do_where_no_image_waits(tmp_path):
    path = tmp_path / f"{232 * 'a'}.rrd"
    assert keep(path, "all").complete


def test_memory_holds_few_pictures_however_many_are_kept(tmp_path):
    size, count = 1 << 20, 40
    with selective(tmp_path / "out.rrd", "worst:40") as recorder:
        plain = recorder.encode(result(0), 0)
        tracemalloc.start()
        for number in range(count):
            large = {path: payload.ljust(size, b"0") for path, payload in plain.payloads.items()}
            recorder.write(replace(plain, when=(number,) * 3, payloads=large))
        del large
        held, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert held < 2 * size * len(plain.payloads)


def test_frames_that_are_dropped_take_no_room(tmp_path):
    with selective(tmp_path / "out.rrd", "worst:2") as recorder:
        plain = recorder.encode(result(0), 0)
        for number in range(50):
            large = {"/camera": bytes(1 << 20)}
            recorder.write(
                replace(plain, when=(number,) * 3, payloads=large, worst_error=number / 50)
            )
        assert len(names(tmp_path / f"{recorder.partial.name}-images")) == 2


def test_a_disk_that_fills_up_ends_the_run_with_one_line_and_a_readable_part(tmp_path, monkeypatch):
    def fail(self, encoded):
        raise RecordingError("the disk is full")

    def fill(recorder):
        with recorder:
            recorder.write(recorder.encode(result(0), 0))
            monkeypatch.setattr(WorstFrames, "offer", fail)
            recorder.write(recorder.encode(result(1), 1))

    recorder = selective(tmp_path / "out.rrd", "worst:3")
    with pytest.raises(RecordingError, match="the disk is full"):
        fill(recorder)
    assert Recording(recorder.partial).frame_numbers == (0,)


PAYLOADS = {"/camera": b"jpeg", "/filtered/post": b""}
ONE_LINE = r"^.*/images: the images put aside cannot be written or read \(.*\); is the disk full\?$"


@pytest.fixture
def worst(tmp_path):
    return WorstFrames(tmp_path / "images", 1)


def test_a_frame_comes_back_with_its_images_alone(worst):
    worst.offer(EncodedFrame((7, 70, 70), PAYLOADS, scalars={"/metrics": 0.5}))
    (back,) = worst.take()
    assert (back.when, back.payloads) == ((7, 70, 70), PAYLOADS)
    assert list(back.payloads) == list(PAYLOADS)
    assert not back.scalars


def test_nothing_is_left_when_it_is_cleared(worst, tmp_path):
    worst.clear()
    for number in (1, 2):
        worst.offer(EncodedFrame((number,) * 3, PAYLOADS, worst_error=number))
    assert [path.name for path in (tmp_path / "images").iterdir()] == ["2"]
    worst.clear()
    assert not list(tmp_path.iterdir())


def test_images_that_were_lost_are_one_line(worst, tmp_path):
    worst.offer(EncodedFrame((7, 70, 70), PAYLOADS))
    (tmp_path / "images" / "7").unlink()
    with pytest.raises(RecordingError, match=ONE_LINE):
        list(worst.take())


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    with pytest.raises(RecordingError, match=ONE_LINE):
        WorstFrames(tmp_path / "missing" / "images", 1).offer(EncodedFrame((7, 70, 70), PAYLOADS))
