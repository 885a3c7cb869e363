"""Drives replayed on demand: one after the other, told about, and ended with the server."""

import time
from threading import Event, Timer

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


def test_drives_are_replayed_one_after_the_other(slow, tmp_path):
    replayer, other = Replayer(), Slow(tmp_path / "b.rrd")
    want(replayer, slow)
    other.go.set()
    assert want(replayer, other).endswith("it begins \N{HORIZONTAL ELLIPSIS}")
    slow.go.set()
    until_done(replayer, slow)
    assert until_done(replayer, other) == ""


def test_a_server_that_ends_ends_its_replays(slow, tmp_path):
    replayer, other = Replayer(), Slow(tmp_path / "b.rrd")
    want(replayer, slow)
    want(replayer, other)
    assert slow.told.wait(10)
    Timer(0.2, slow.go.set).start()
    replayer.close()
    assert not slow.recording.exists()
    assert other.runs == 0


def test_why_it_failed_is_told_once_and_then_it_begins_again(tmp_path):
    replayer, slow = Replayer(), Slow(tmp_path / "a.rrd", failure="the log has gone")
    slow.go.set()
    with pytest.raises(RoadevalError, match="the log has gone"):
        until_done(replayer, slow)
    assert want(replayer, slow).startswith("Replaying")
    replayer.close()
