"""The result of a replay on one screen; progress at a terminal and elsewhere."""

import io
import tomllib
from dataclasses import replace
from itertools import chain
from pathlib import Path

import pytest
from rich.console import Console
from rich.progress import Progress as Display

from roadeval import Outcome, Progress
from roadeval.cli import console, messages, progress
from roadeval.cli.screens import fleet, tables
from roadeval.cli.screens import replay as outcome
from roadeval.evaluation.score.scoreboard import Effect
from roadeval.report.blocks import Table
from roadeval.results.facts import (
    DriveFacts,
    FleetFacts,
    FrameAccount,
    LogFacts,
    Member,
    UnlabelledFacts,
)
from tests.report.making import a_difference, a_total
from tests.results.making import facts_of


def screen(labelled=0, recording=None, files=(), errors=(), **parts):
    """The screen of a drive of which nothing was scored unless there are totals."""
    frames = FrameAccount(39, 39, labelled=labelled, skipped={"unlabelled": 39})
    facts = facts_of(drive=DriveFacts("drive"), frames=frames, **parts)
    out = Console(file=io.StringIO(), width=80)
    outcome.show(Outcome(recording, Path("reports"), facts, (), (), files, errors=errors), out)
    outcome.show_verdict(facts, out)
    return out.file.getvalue()


def a_mask(err=0.1):
    return {"post": a_total(err)}


@pytest.mark.parametrize(
    ("labelled", "why"), [(0, "has road truth"), (10, "was trained on or left out")]
)
def test_where_nothing_is_scored_it_says_why(labelled, why):
    shown = screen(labelled)
    assert shown.startswith("drive: 0 of 39 frames were evaluated. Left out: 39 without truth.\n")
    assert "Nothing to score: " in shown
    assert why in shown
    assert "%" not in shown


@pytest.mark.parametrize(
    ("display", "words"),
    [
        (":0", ["report", "rerun", "inspect"]),
        ("", ["report", "inspect", "inspect"]),
    ],
)
def test_what_to_type_next_can_be_typed_here(display, words, monkeypatch, tmp_path):
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    recording = tmp_path / "out.rrd"
    recording.write_bytes(b"")
    shown = screen(1, recording, totals={"filtered": a_mask()})
    programs = [line.split()[1:] for line in shown.splitlines() if line.startswith("next ")]
    assert all(Path(program).exists() for program, *_ in programs)
    called = [["rerun"] if "rerun" in name else [word] for name, word, *_ in programs]
    assert [*chain(*called)] == words


UNLABELLED = UnlabelledFacts(39, "filtered", None, [], {})


@pytest.mark.parametrize(
    ("parts", "step"),
    [
        ({"unlabelled": UNLABELLED}, "pick out.rrd -n 20 -o to_label"),
        (
            {"labelled": 1, "totals": {"filtered": a_mask(), "a": a_mask(), "b": a_mask()}},
            "compare out.rrd --variant b --variant a",
        ),
        (
            {"labelled": 1, "totals": {"filtered": a_mask(), "my net": a_mask()}},
            "compare out.rrd --variant filtered --variant 'my net'",
        ),
        (
            {
                "labelled": 1,
                "totals": {"filtered": a_mask()},
                "log": LogFacts("d.mcap", "0"),
                "verdict": "filtered: bad. Next: try --variant robust.",
            },
            "replay d.mcap --config out.rrd --variant robust --save out_robust.rrd",
        ),
    ],
)
def test_the_second_line_of_what_to_type_next_fits_the_result(parts, step, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("out.rrd").touch()
    shown = screen(recording=Path("out.rrd"), **parts)
    first, second, *others = [line for line in shown.splitlines() if line.startswith("next ")]
    assert first.endswith("roadeval report out.rrd -o out.html")
    assert second.endswith(f"roadeval {step}")
    assert len(others) < 2


def test_a_second_run_without_a_recording_leaves_the_results_of_the_first():
    parts = {"totals": {"filtered": a_mask()}, "log": LogFacts("d.mcap", "0"), "labelled": 1}
    verdict = "filtered: bad. Next: try --variant robust."
    shown = screen(verdict=verdict, **parts)
    command = "replay d.mcap --config reports/run.toml --variant robust --reports reports_robust"
    assert f"roadeval {command}\n" in shown


def test_the_figures_are_named_once_and_the_verdict_stands_last():
    files = tuple(Path("reports", name) for name in ("fig2_masks.png", "fig2_masks.pdf", "a.csv"))
    shown = screen(1, files=files, totals={"filtered": a_mask()}, verdict="filtered: fine.")
    assert "figures    reports/fig2_masks.png\n" in shown
    assert shown.endswith("\n\nfiltered: fine.\n")


def test_the_error_along_the_drive_is_a_line_of_bars():
    shown = screen(1, errors=(0.0, 0.2, 0.4), totals={"filtered": a_mask()})
    assert "\nerror      ▁▄█ up to 40.0 % (filtered)\n" in shown
    many = screen(1, errors=(0.4, *[0.0] * 999), totals={"filtered": a_mask()})
    (line,) = [line for line in many.splitlines() if line.startswith("error ")]
    assert line.startswith("error      █▁")
    assert len(line) <= 80


@pytest.mark.parametrize(
    ("change", "misfits", "colour"),
    [(-0.1, [], "32"), (0.1, [], "31"), (-0.1, ["The truth is late."], "33"), (None, [], "")],
)
def test_a_verdict_is_green_if_the_focus_beats_the_baseline_and_red_if_not(change, misfits, colour):
    effects = (
        []
        if change is None
        else [Effect("blind", "filtered", "post", True, {"ERR": a_difference(change)})]
    )
    facts = facts_of(
        verdict="It is so.", totals={"filtered": a_mask()}, effects=effects, misfits=misfits
    )
    out = Console(file=io.StringIO(), width=80, force_terminal=True, color_system="standard")
    outcome.show_verdict(facts, out)
    assert out.file.getvalue() == f"\n\x1b[1{colour and ';'}{colour}mIt is so.\x1b[0m\n"


def test_headings_of_several_words_have_lines_before_a_table_is_divided():
    columns = ["drive", "against unfiltered", "against blind"]
    table = Table(columns, [["a" * 20, "+1.00", "+2.00"]], text_columns=(0,))
    out = Console(file=io.StringIO(), width=42)
    tables.show_table(table, out)
    assert [line.split() for line in out.file.getvalue().splitlines()[:3]] == [
        ["against", "against"],
        ["drive", "unfiltered", "blind"],
        ["\N{BOX DRAWINGS LIGHT HORIZONTAL}" * 41],
    ]


@pytest.mark.parametrize(
    ("labels", "clear", "odd"),
    [
        ({"road": [3], "ignore": []}, ["labels = { road = [3] }"], []),
        ({}, [], ["labels = { road = [1] }"]),
    ],
)
def test_a_fleet_with_mixed_labels_gets_a_manifest_to_copy(labels, clear, odd):
    facts = FleetFacts(
        verdict="",
        version="",
        counts={},
        frames=0,
        totals={},
        effects=[],
        strata=[],
        warnings=[],
        run={"labels": labels},
        drives=[Member(name, name, f"{name}.mcap") for name in ("ids", "masks")],
        failed={"masks": "masks.mcap: `labels.road`: 3 does not occur in /truth"},
    )
    lines = [*fleet.manifest(facts)]
    drives = tomllib.loads("\n".join(lines))["drives"]
    assert [drive["path"] for drive in drives] == ["ids.mcap", "masks.mcap"]
    assert lines == [
        *("", "[[drives]]", 'path = "ids.mcap"', *clear),
        *("", "[[drives]]", 'path = "masks.mcap"', *odd),
    ]
    assert [*fleet.manifest(replace(facts, failed={"masks": "empty"}))] == []


@pytest.mark.parametrize("terminal", [True, False])
def test_a_message_breaks_between_words_at_a_terminal_and_nowhere_else(terminal, monkeypatch):
    screen = Console(file=io.StringIO(), force_terminal=terminal, width=30, no_color=True)
    monkeypatch.setattr(console, "diagnostics", lambda: screen)
    messages.error("the file recordings/of-yesterday.mcap is not there")
    begin, end = ("\x1b[1m", "\x1b[0m") if terminal else ("", "")
    lines = [
        f"roadeval: {begin}error:{end} the file",
        "recordings/of-yesterday.mcap",
        "is not there",
    ]
    assert screen.file.getvalue() == ("\n    " if terminal else " ").join(lines) + "\n"


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
