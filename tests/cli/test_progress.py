"""Progress: a bar at a terminal, plain lines elsewhere."""

import io
from dataclasses import dataclass

from rich.console import Console

from roadeval.cli import console, progress


@dataclass(frozen=True)
class Step:
    done: int
    total: int | None
    stage: str = "replaying"


class Clock:
    """A clock that stands until it is moved."""

    seconds = 100.0

    def __call__(self):
        return self.seconds


def lines_of(steps):
    """The plain lines that a job writes whose steps come at these seconds."""
    clock, written = Clock(), []
    watch = progress.Lines(written.append, progress.StageClock(clock))
    for seconds, step in steps:
        clock.seconds = 100 + seconds
        watch(step)
    return written


def test_the_first_step_of_a_stage_is_a_line():
    steps = [(0, Step(1, 10, "training")), (1, Step(2, 10, "training")), (2, Step(1, 50))]
    assert lines_of(steps) == ["training: 1 of 10 frames", "replaying: 1 of 50 frames"]


def test_before_the_first_frame_there_are_no_frames_to_tell_of():
    steps = [(0, Step(0, 10, "compiling")), (1, Step(1, 10, "training"))]
    assert lines_of(steps) == ["compiling", "training: 1 of 10 frames"]


def test_a_line_comes_now_and_then_with_rate_and_time_left():
    steps = [(second, Step(1 + 2 * second, 101)) for second in range(25)]
    assert lines_of(steps) == [
        "replaying: 1 of 101 frames",
        "replaying: 21 of 101 frames, 2.0 frames/s, 40 s left",
        "replaying: 41 of 101 frames, 2.0 frames/s, 30 s left",
    ]


def test_a_job_of_unknown_length_tells_no_time_left():
    steps = [(0, Step(0, None)), (10, Step(5, None))]
    assert lines_of(steps) == ["replaying", "replaying: 5 frames, 0.5 frames/s"]


def test_quiet_says_nothing(capsys):
    with progress.watched(quiet=True) as watch:
        watch(Step(1, 10))
    assert capsys.readouterr() == ("", "")


def test_without_a_terminal_the_lines_go_to_stderr(capsys):
    with progress.watched() as watch:
        watch(Step(1, 10))
    assert capsys.readouterr() == ("", "replaying: 1 of 10 frames\n")


def test_at_a_terminal_there_is_a_bar(monkeypatch):
    screen = Console(file=io.StringIO(), force_terminal=True, width=80)
    monkeypatch.setattr(console, "diagnostics", lambda: screen)
    with progress.watched() as watch:
        watch(Step(40, 100))
        watch(Step(60, 100))
    shown = screen.file.getvalue()
    assert "replaying" in shown
    assert "60/100" in shown
    assert "frames/s" in shown


def test_the_bar_has_no_end_before_the_first_frame(monkeypatch):
    screen = Console(file=io.StringIO(), force_terminal=True, width=80)
    monkeypatch.setattr(console, "diagnostics", lambda: screen)
    with progress.watched() as watch:
        watch(Step(0, 100, "compiling"))
    shown = screen.file.getvalue()
    assert "compiling" in shown
    assert "0/100" not in shown
