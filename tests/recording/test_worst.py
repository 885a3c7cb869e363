"""Which frames' images are kept by a rule, whatever ends the run."""

from dataclasses import replace

import numpy as np
import pytest

from roadeval.data import Doubt
from roadeval.recording import recorder as recorder_module
from roadeval.recording.layout import RecordRule
from roadeval.recording.recorder import Recorder
from roadeval.recording.recording import Recording
from tests.recording.making import RESULTS, layout, result
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


def test_no_more_is_held_than_there_is_room_for_and_the_run_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder_module, "HELD", 3 << 20)
    with selective(tmp_path / "out.rrd", "worst:40") as recorder:
        plain = recorder.encode(result(0), 0)
        for number, err in enumerate([0.1, 0.5, 0.3, 0.5, 0.2, 0.4]):
            payloads = {"/camera": b"0" * (1 << 20)}
            each = plain._replace(when=(number,) * 3, payloads=payloads, error=err)
            said = recorder.forecast(each, 6)
            assert said.endswith("worst:40 keeps those that fit in 3 MiB of memory, about 3") or (
                number and not said
            )
            recorder.write(each)
        recorder.finish(RESULTS)
    assert Recording(recorder.path).frame_numbers == (1, 3, 5)
