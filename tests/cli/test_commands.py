"""The commands `train`, `info` and `replay`: what they hand on, and what they say."""

import io
import tomllib
from dataclasses import replace
from itertools import chain
from pathlib import Path

import cv2
import numpy as np
import pytest
from rich.console import Console
from rich.progress import Progress as Display

from roadeval import Outcome, Progress, RunConfig, configure
from roadeval.cli import console, messages, progress
from roadeval.cli.app import main
from roadeval.cli.options import OPTIONS, with_flags
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
from roadeval.runtime.sentence import Sentence, Setting
from tests.fixtures.logged import jpeg, write_drive
from tests.fixtures.make import make
from tests.jobs.making import write_log
from tests.report.making import a_difference, a_total
from tests.results.making import facts_of

PATCH = '[training]\nsource = "patch"\nframes = 3'


@pytest.fixture
def bare(tmp_path, monkeypatch):
    """A log without truth in the current folder, and a configuration that asks for the patch."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "patch.toml").write_text(PATCH)
    return write_log(tmp_path / "bare.mcap", truth=False)


def test_the_patch_trains_a_log_without_truth(bare, capsys):
    assert main(["train", "bare.mcap", "--config", "patch.toml", "-o", "m.model"]) == 0
    streams = capsys.readouterr()
    assert "m.model: filtered, unfiltered; trained on 3 frames" in streams.out
    assert streams.out.endswith("pixels, by the patch\n")
    assert "guess" not in streams.err


def test_what_holds_for_one_drive_is_read_from_a_manifest(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ids.toml").write_text('[[drives]]\npath = "ids.mcap"\nlabels = { road = [3] }\n')
    write_log(tmp_path / "mask.mcap")
    write_log(tmp_path / "ids.mcap", codes=(5, 3))
    words = ["train", "mask.mcap", "ids.mcap", "-o", "m.model", "--train-frames", "2"]
    assert main([*words, "ids.toml"]) == 0
    streams = capsys.readouterr()
    assert "by the truth" in streams.out
    assert "warning" not in streams.err
    assert main(words) == 1
    assert "ids.mcap: /truth/road holds the values 3 5" in capsys.readouterr().err


def test_what_was_left_out_is_told_and_decides_the_exit_code(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path / "broken.mcap", broken=8)
    assert main(["train", "broken.mcap", "-o", "m.model", "--train-frames", "3", "-q"]) == 3
    stderr = capsys.readouterr().err
    assert "roadeval: lost: frame 8: 8 bytes that are not an image" in stderr
    assert "roadeval: lost: 1 of 3 training frames could not be decoded" in stderr
    assert (tmp_path / "m.model").exists()


def test_of_several_logs_the_one_that_frames_are_picked_from_is_named_with_its_folder(bare, capsys):
    write_log(bare.with_name("longer.mcap"), truth=False, numbers=range(40))
    words = ["bare.mcap", "longer.mcap", "-n", "1", "-o", "picks", "--config", "patch.toml"]
    assert main(["pick", *words]) == 0
    command = capsys.readouterr().out.rpartition("next")[2]
    assert "replay longer.mcap --config picks/longer/run.toml --truth picks/longer" in command


# --- The command ``pack``: a folder of images becomes a log that ``info`` and ``replay`` take -----


@pytest.fixture
def folder(tmp_path):
    """Three images in ``imgs``, and masks for the first two of them in ``masks``."""
    for name in ("imgs", "masks"):
        (tmp_path / name).mkdir()
    for number in range(3):
        image = np.full((6, 8, 3), 40 * number, np.uint8)
        cv2.imwrite(str(tmp_path / "imgs" / f"{number}.jpg"), image)
        if number < 2:
            cv2.imwrite(str(tmp_path / "masks" / f"{number}.png"), image[..., 0] * 0 + 255)
    return tmp_path


def test_images_and_masks_become_one_log(folder, capsys):
    words = ["pack", f"{folder}/imgs", "--truth", f"{folder}/masks", "-o", f"{folder}/d.mcap"]
    assert main(words) == 0
    streams = capsys.readouterr()
    assert "d.mcap: 3 images, 2 with a mask; 10 images a second" in streams.out
    assert "images without a mask: 2.jpg" in streams.err
    main(["info", f"{folder}/d.mcap"])
    assert "truth: /truth/road" in capsys.readouterr().out


SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND


@pytest.fixture
def write(tmp_path):
    """Write a log of 1 Hz with these topics; masks where a topic's values are given."""

    def write(topics, seconds=range(4)):
        grey = np.full((6, 8), 120, np.uint8)
        messages = {
            topic: np.resize(np.uint8(values), (6, 8)) if values else jpeg(grey)
            for topic, values in topics.items()
        }
        stamps = (START + second * SECOND for second in seconds)
        return str(write_drive(tmp_path / "drive.mcap", ((stamp, messages) for stamp in stamps)))

    return write


def test_it_tells_what_replay_would_ask_for(write, capsys):
    drive = write({"/camera": None, "/labels": [0, 1, 2, 3]})
    assert main(["info", drive]) == 0
    assert "replay would stop: drive.mcap: /labels holds the values 0 1 2 3" in (
        capsys.readouterr().out
    )
    main(["info", drive, "--road-label", "3"])
    assert "truth: /labels (" in capsys.readouterr().out


def test_it_tells_where_messages_are_missing(write, capsys):
    main(["info", write({"/camera": None}, seconds=[0, 1, 2, 3, 9])])
    assert "/camera: gap of 6.00 s, 3.00 s after the start" in capsys.readouterr().out


def test_damage_is_told_and_has_its_exit_code(tmp_path, capsys):
    assert main(["info", str(make("broken/trunc_midchunk.mcap", tmp_path))]) == 3
    assert capsys.readouterr().err.startswith("roadeval: lost: trunc_midchunk.mcap: ")


FACTS = facts_of(
    drive=DriveFacts("drive"), frames=FrameAccount(3, 3, labelled=0, skipped={"unlabelled": 3})
)


@pytest.fixture
def job(monkeypatch):
    """The arguments of the main job, which does nothing, and what it returns."""
    job = {"warnings": (), "losses": ()}

    def replay(drive, config, *, on_progress):
        job.update(drive=drive, config=config)
        on_progress(Progress(3, 3, "replaying"))
        return Outcome(None, None, FACTS, job["warnings"], job["losses"], ())

    monkeypatch.setattr("roadeval.jobs.run.replay.replay", replay)
    return job


def test_every_option_arrives(job, tmp_path):
    settings = tmp_path / "narrow.toml"
    settings.write_text("[shadow]\nring_width = 3\n")
    words = (
        "replay drive.mcap --save out.rrd --reports out --mcap o.mcap --preset printed "
        f"--config {settings} --variant narrow={settings} --train-frames 5 "
        "--train-gap 2 --image-topic /image --truth-topic /truth --shadow-topic /shadow "
        "--road-label 3 --road-label 4 --ignore-label 11 --mask-topic net=/net "
        "--sync-tolerance 2.5 --resize-truth -S 1.5 -E 2013-05-01T12:00:00Z "
        "--every 2 --max-frames 7 --record none --jobs 1"
    )
    assert main(words.split()) == 0
    assert job["config"] == configure(
        {
            "preset": "printed",
            "shadow": {"ring_width": 3},
            "variants": {"narrow": {"shadow": {"ring_width": 3}}},
            "training": {"frames": 5, "gap": 2},
            "topics": {
                "image": "/image",
                "truth": "/truth",
                "shadow": "/shadow",
                "masks": {"net": "/net"},
                "sync_tolerance_ms": 2.5,
                "resize_truth": True,
            },
            "labels": {"road": [3, 4], "ignore": [11]},
            "frames": {"start": "1.5", "end": "2013-05-01T12:00:00Z", "every": 2, "max_frames": 7},
            "output": {"save": "out.rrd", "reports": "out", "mcap": "o.mcap", "record": "none"},
            "run": {"jobs": 1},
        }
    )


def test_a_preset_that_is_not_the_file_s_is_refused(job, tmp_path, capsys):
    (tmp_path / "c.toml").write_text('preset = "gated"\n')
    words = ["replay", "d.mcap", "--config", str(tmp_path / "c.toml"), "--preset"]
    assert main([*words, "gated"]) == 0
    assert main([*words, "robust"]) == 1
    assert "starts from preset gated, not from robust" in capsys.readouterr().err


def test_a_model_and_training_frames_do_not_go_together(capsys):
    assert main(["replay", "d.mcap", "--model", "m", "--train-gap", "3"]) == 2
    assert (
        "--train-frames, --train-on and --train-gap do not go with a model (m)"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--road-label 3 --road-label 70000", "--road-label: item 2 must be at most 65535"),
        (f"--road-label {'9' * 5000}", "--road-label: item 1 must be a whole number"),
        ("--every 0", "--every: must be at least 1 (given: 0)"),
    ],
)
def test_a_value_that_cannot_be_is_named_by_its_flag(words, message, capsys):
    assert main(["replay", "d.mcap", *words.split()]) == 2
    assert f"roadeval: error: {message}" in capsys.readouterr().err


def test_every_option_s_words_are_a_setting_s_value(job):
    """Every option of the help sets another setting."""
    assert main(["replay", "d.mcap", "--model", "city.model"]) == 0
    assert job["config"].training.model == "city.model"
    flags = [flag for option in OPTIONS for flag in option.flags]
    assert len({*flags}) == len(flags)
    for option in OPTIONS:
        table, _, key = option.setting.partition(".")
        assert not key or hasattr(getattr(RunConfig(), table), key)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("lower {training.frames} or {frames.scale}", "lower --train-frames or --scale"),
        ("a `topics.truth` that is text", "a `topics.truth` that is text"),
        ("{training.source} has no flag", "`training.source` has no flag"),
        ("{masks} my-net: bad", "--masks my-net: bad"),
        (Setting("masks.my-net.first"), "`first` in the file of --masks my-net=FILE.toml"),
        (Setting("topics.masks.net"), "--mask-topic net"),
        (Setting("net.road"), "`road` in the file of --net NAME=FILE.toml"),
    ],
)
def test_settings_in_a_sentence_are_named_by_their_flags(text, shown):
    sentence = Sentence("{}", text) if isinstance(text, Setting) else Sentence(text)
    assert with_flags(sentence) == shown


def test_warnings_are_told_even_when_quiet(job, capsys):
    job["warnings"] = ("the classifier of filtered calls everything road",)
    assert main(["replay", "drive.mcap", "--quiet"]) == 0
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err == ("roadeval: warning: the classifier of filtered calls everything road\n")


def test_a_loss_is_told_and_has_its_exit_code(job, capsys):
    job["losses"] = ("frame 7: its JPEG ends early",)
    assert main(["replay", "drive.mcap", "--quiet"]) == 3
    assert capsys.readouterr().err == "roadeval: lost: frame 7: its JPEG ends early\n"


@pytest.mark.parametrize(
    "words", ["--road-color 1,2", "--road-color red", "--mask-topic net", "--mask-topic truth=/x"]
)
def test_colours_and_masks_are_checked_before_anything_is_opened(words, capsys):
    assert main(["replay", "drive.mcap", *words.split()]) == 2
    assert capsys.readouterr().err.count("\n") == 1


# --- The result of a replay on one screen; progress at a terminal and elsewhere -------------------


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
