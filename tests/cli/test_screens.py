"""The result of a replay on one screen; progress at a terminal and elsewhere."""

import io
from pathlib import Path

import pytest
from rich.console import Console
from rich.progress import Progress as Display

from roadeval.cli import console, progress
from roadeval.cli.screens import replay as outcome
from roadeval.jobs.progress import Progress
from roadeval.jobs.run.replay import Outcome
from roadeval.results.facts import DriveFacts, FrameAccount
from tests.report.making import a_total
from tests.results.making import facts_of


def screen(labelled=0, recording=None, totals=None):
    """The screen of a drive of which nothing was scored unless there are totals."""
    frames = FrameAccount(39, 39, labelled=labelled, skipped={"unlabelled": 39})
    facts = facts_of(drive=DriveFacts("drive"), frames=frames, totals=totals or {})
    out = Console(file=io.StringIO(), width=80)
    outcome.show(Outcome(recording, Path("reports"), facts, (), (), ()), out)
    return out.file.getvalue()


@pytest.mark.parametrize(
    ("labelled", "why"), [(0, "has road truth"), (10, "was trained on or left out")]
)
def test_where_nothing_is_scored_it_says_why(labelled, why):
    shown = screen(labelled)
    assert shown.startswith("drive: 0 of 39 frames were evaluated. Left out: 39 without truth.\n")
    assert "Nothing to score: " in shown
    assert why in shown
    assert "%" not in shown


@pytest.mark.parametrize(("display", "first"), [(":0", "rerun"), ("", "inspect")])
def test_what_to_type_next_can_be_typed_here(display, first, monkeypatch, tmp_path):
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    recording = tmp_path / "out.rrd"
    recording.write_bytes(b"")
    shown = screen(recording=recording, totals={"filtered": {"post": a_total(0.1)}})
    programs = [line.split()[1:] for line in shown.splitlines() if line.startswith("next ")]
    assert all(Path(program).exists() for program, *_ in programs)
    assert [first in " ".join(words[:2]) for words in programs] == [True, first == "inspect", False]


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
