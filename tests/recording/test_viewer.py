"""What the viewer needs from the machine, and what is said where it lacks that or is late."""

from contextlib import contextmanager
from pathlib import Path

import pytest

from roadeval.recording import viewer
from roadeval.recording.layout import RecordingError
from roadeval.recording.viewer import WindowViewer


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """A viewer that says how it was called and ends at once."""
    script = tmp_path / "rerun"
    script.write_text('#!/bin/sh\necho "$@ CI=$CI"\nexit 3\n')
    script.chmod(0o700)
    monkeypatch.setenv("VK_ICD_FILENAMES", "/my/driver.json")
    monkeypatch.setattr(viewer, "_program", lambda: str(script))


def test_a_viewer_that_does_not_start_is_quoted_and_would_listen_on_this_machine_alone(
    fake, tmp_path
):
    said = r"the viewer did not start: .*--bind 127\.0\.0\.1 --port \d+ .* CI=1"
    with pytest.raises(RecordingError, match=said):
        viewer.screenshot(tmp_path / "x.rrd", tmp_path / "x.png")


@pytest.mark.parametrize("screen", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_a_screen_of_either_kind_will_do(screen, fake, tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(RecordingError, match="No screen to open a window on"):
        viewer.show(tmp_path / "x.rrd")
    monkeypatch.setenv(screen, ":0")
    with pytest.raises(RecordingError, match="the viewer did not start"):
        viewer.show(tmp_path / "x.rrd")


def test_a_viewer_that_is_late_is_asked_again():
    answers = iter([TimeoutError("Deadline expired"), TimeoutError("Deadline expired"), "drawn"])

    def ask():
        answer = next(answers)
        if isinstance(answer, Exception):
            raise answer
        return answer

    assert viewer.asked(ask) == "drawn"


@pytest.mark.parametrize(
    ("failure", "said"),
    [
        (TimeoutError("Deadline expired"), "the viewer did not answer within 0 s"),
        (ConnectionError("tcp connect error"), "the viewer has ended: tcp connect error"),
        (RuntimeError("no window"), "the viewer has ended: no window"),
    ],
)
def test_a_viewer_that_never_answers_or_has_ended_is_told_in_one_line(failure, said, monkeypatch):
    monkeypatch.setattr(viewer, "_LOADING_S", 0.0)

    def ask():
        raise failure

    with pytest.raises(RecordingError, match=f"^{said}$"):
        viewer.asked(ask)


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

    monkeypatch.setattr(viewer, "opened", opened)
    monkeypatch.setattr(viewer, "go", lambda window, frame: window["frames"].append(frame))
    monkeypatch.setattr(viewer, "has_screen", lambda: True)
    return made


def test_one_window_is_led_from_frame_to_frame(windows):
    window = WindowViewer()
    for frame in (84, 12):
        window.show(Path("a.rrd"), frame)
    (window,) = windows
    assert window["frames"] == [84, 12]
    assert not window["ended"]


def test_another_recording_takes_the_place_of_the_first(windows):
    window = WindowViewer()
    window.show(Path("a.rrd"), 1)
    window.show(Path("b.rrd"), 2)
    assert [(each["recording"].name, each["ended"]) for each in windows] == [
        ("a.rrd", True),
        ("b.rrd", False),
    ]
