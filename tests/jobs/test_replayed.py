"""Drives replayed on demand: one at a time, told about, and cancelled."""

import time
from threading import Event

import pytest

from roadeval.errors import RoadevalError
from roadeval.jobs.progress import Progress
from roadeval.jobs.serve.replayed import Replayer


class Slow:
    """A replay that tells of a frame when it is let, and then makes its file."""

    def __init__(self, recording, failure=None):
        self.recording, self.failure = recording, failure
        self.go, self.told = Event(), Event()
        self.runs = 0

    def __call__(self, on_progress):
        self.runs += 1
        on_progress(Progress(3, 40, "replaying"))
        self.told.set()
        self.go.wait(10)
        on_progress(Progress(4, 40, "replaying"))
        if self.failure:
            raise RoadevalError(self.failure)
        self.recording.touch()


def want(replayer, slow):
    return replayer.want(slow.recording, "monday", slow)


def until_done(replayer, slow):
    """Ask until there is another answer than where it stands."""
    for _ in range(500):
        if not (state := want(replayer, slow)):
            return state
        time.sleep(0.01)
    raise AssertionError(state)


@pytest.fixture
def slow(tmp_path):
    return Slow(tmp_path / "a.rrd")


def test_who_asks_hears_how_far_it_is_until_it_is_there(slow):
    replayer = Replayer()
    assert want(replayer, slow).startswith("Replaying monday: ")
    assert slow.told.wait(10)
    assert want(replayer, slow) == "Replaying monday: replaying 3 of 40 \N{HORIZONTAL ELLIPSIS}"
    slow.go.set()
    assert until_done(replayer, slow) == ""
    assert want(replayer, slow) == ""
    assert slow.runs == 1


def test_what_is_there_is_not_replayed(slow):
    slow.recording.touch()
    assert want(Replayer(), slow) == ""
    assert slow.runs == 0


def test_only_one_drive_at_a_time(slow, tmp_path):
    replayer, other = Replayer(), Slow(tmp_path / "b.rrd")
    want(replayer, slow)
    with pytest.raises(RoadevalError, match="one drive is replayed at a time"):
        want(replayer, other)
    slow.go.set()
    until_done(replayer, slow)
    other.go.set()
    assert until_done(replayer, other) == ""


def test_a_cancelled_replay_has_ended_and_may_begin_again(slow):
    replayer = Replayer()
    want(replayer, slow)
    assert slow.told.wait(10)
    slow.go.set()
    replayer.cancel(slow.recording)
    assert not slow.recording.exists()
    assert until_done(replayer, slow) == ""
    assert slow.runs == 2


def test_another_drives_replay_is_not_cancelled(slow, tmp_path):
    replayer = Replayer()
    want(replayer, slow)
    replayer.cancel(tmp_path / "b.rrd")
    slow.go.set()
    assert until_done(replayer, slow) == ""


def test_why_it_failed_is_told_once_and_then_it_begins_again(tmp_path):
    replayer, slow = Replayer(), Slow(tmp_path / "a.rrd", failure="the log has gone")
    slow.go.set()
    with pytest.raises(RoadevalError, match="the log has gone"):
        until_done(replayer, slow)
    assert want(replayer, slow).startswith("Replaying")
    replayer.cancel()


def test_nothing_to_cancel_is_no_problem():
    Replayer().cancel()
