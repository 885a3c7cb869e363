"""A viewer that is opened once and steered; here without a window."""

from contextlib import contextmanager
from pathlib import Path

import pytest

from roadeval.recording.layout import RecordingError
from roadeval.recording.screen import viewer as module
from roadeval.recording.screen.viewer import WindowViewer


class Process:
    """A viewer's process: it runs until somebody closes the window."""

    def __init__(self):
        self.code = None

    def poll(self):
        return self.code


@pytest.fixture
def windows(monkeypatch):
    """What became of each window, in order: the recording, its process, and what is shown."""
    made = []

    @contextmanager
    def opened(recording):
        window = {"recording": recording, "process": Process(), "frames": [], "ended": False}
        made.append(window)
        yield window["process"], window
        window["ended"] = True

    monkeypatch.setattr(module, "opened", opened)
    monkeypatch.setattr(module, "go", lambda window, frame: window["frames"].append(frame))
    monkeypatch.setattr(module, "has_screen", lambda: True)
    return made


def test_one_window_is_led_from_frame_to_frame(windows):
    viewer = WindowViewer()
    for frame in (84, 12):
        viewer.show(Path("a.rrd"), frame)
    (window,) = windows
    assert window["frames"] == [84, 12]
    assert not window["ended"]


def test_another_recording_takes_the_place_of_the_first(windows):
    viewer = WindowViewer()
    viewer.show(Path("a.rrd"), 1)
    viewer.show(Path("b.rrd"), 2)
    assert [(each["recording"].name, each["ended"]) for each in windows] == [
        ("a.rrd", True),
        ("b.rrd", False),
    ]


def test_a_window_that_was_closed_is_opened_again(windows):
    viewer = WindowViewer()
    viewer.show(Path("a.rrd"), 1)
    windows[0]["process"].code = 0
    viewer.show(Path("a.rrd"), 2)
    assert [each["frames"] for each in windows] == [[1], [2]]


def test_it_ends_with_whoever_started_it(windows):
    viewer = WindowViewer()
    viewer.show(Path("a.rrd"), 1)
    viewer.close()
    assert windows[0]["ended"]


def test_without_a_screen_it_says_what_to_do(windows, monkeypatch):
    monkeypatch.setattr(module, "has_screen", lambda: False)
    with pytest.raises(RecordingError, match="on a machine that has one"):
        WindowViewer().show(Path("a.rrd"), 1)
    assert windows == []
