"""The result of a replay on one screen."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from roadeval.cli.screens import replay as outcome
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
