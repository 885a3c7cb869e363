"""Progress: a bar at a terminal, plain lines elsewhere."""

import io

from rich.console import Console
from rich.progress import Progress as Display

from roadeval.cli import console, progress
from roadeval.jobs.progress import Progress


class Clock:
    """A clock that stands until it is moved."""

    seconds = 100.0

    def __call__(self):
        return self.seconds


def step(done, total, stage="replaying"):
    return Progress(done, total, stage)


def lines_of(steps, monkeypatch):
    """The plain lines that a job writes whose steps come at these seconds."""
    clock, written = Clock(), []
    monkeypatch.setattr(progress.time, "monotonic", clock)
    with Display(get_time=clock, disable=True) as display:
        watch = progress.Watch(display, written.append, lines=True)
        for seconds, step in steps:
            clock.seconds = 100 + seconds
            watch(step)
    return written


def test_the_first_step_of_a_stage_is_a_line(monkeypatch):
    steps = [(0, step(1, 10, "training")), (1, step(2, 10, "training")), (2, step(1, 50))]
    assert lines_of(steps, monkeypatch) == ["training: 1 of 10 frames", "replaying: 1 of 50 frames"]


def test_a_line_comes_now_and_then_with_rate_and_time_left(monkeypatch):
    steps = [(second, step(1 + 2 * second, 101)) for second in range(25)]
    assert lines_of(steps, monkeypatch) == [
        "replaying: 1 of 101 frames",
        "replaying: 21 of 101 frames, 2.0 frames/s, 40 s left",
        "replaying: 41 of 101 frames, 2.0 frames/s, 30 s left",
    ]


def test_at_a_terminal_there_is_a_bar(monkeypatch):
    screen = Console(file=io.StringIO(), force_terminal=True, width=80)
    monkeypatch.setattr(console, "diagnostics", lambda: screen)
    with progress.show() as watch:
        watch(step(40, 100))
        watch(step(50, 100))
        watch(step(60, 100))
    shown = screen.file.getvalue()
    assert "replaying" in shown
    assert "60 of 100" in shown
    assert "frames/s" in shown
