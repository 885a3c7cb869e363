"""The command ``replay``: what it hands to the main job, and what it makes of the outcome."""

import json
from pathlib import Path

import pytest

from roadeval.cli.app import main
from roadeval.config import Config
from roadeval.jobs import replay as job
from roadeval.jobs.options import Outcome, Progress, ReplayOptions

SUMMARY = {
    "verdict": "",
    "drive": {"name": "drive"},
    "frames": {"in_log": 3, "read": 3, "evaluated": 0, "labelled": 0, "skipped": {"unlabelled": 3}},
    "totals": {},
    "difference": {},
    "windows": 0,
    "health": {},
    "beyond": {},
    "oracles": {},
    "training": {},
    "seconds": {},
    "warnings": [],
    "losses": [],
    "selection": {},
    "settings": {},
    "versions": {},
    "log": {},
}


@pytest.fixture
def asked(monkeypatch):
    """What the main job was asked for; it does nothing and is done at once."""
    asked = {"warnings": (), "losses": ()}

    def replay(drive, *, save, reports, mcap, options, on_progress):
        asked.update(drive=drive, save=save, reports=reports, mcap=mcap, options=options)
        on_progress(Progress(3, 3, "replaying"))
        return Outcome(None, None, SUMMARY, asked["warnings"], asked["losses"], ())

    monkeypatch.setattr("roadeval.jobs.replay.replay", replay)
    return asked


def test_the_defaults_are_those_of_the_library(asked):
    assert main(["replay", "drive.mcap"]) == 0
    assert asked["drive"] == Path("drive.mcap")
    assert asked["save"] is asked["reports"] is asked["mcap"] is None
    assert asked["options"] == ReplayOptions()


def test_every_option_arrives(asked, tmp_path):
    settings = tmp_path / "narrow.toml"
    settings.write_text("[shadow]\nring_width = 3\n")
    words = (
        "replay drive.mcap --save out.rrd --reports out --mcap o.mcap --preset printed "
        f"--config {settings} --variant narrow={settings} --model city.model --train-frames 5 "
        "--train-gap 2 --image-topic /image --truth-topic /truth --shadow-topic /shadow "
        "--road-label 3 --road-label 4 --ignore-label 11 --mask-topic net=/net "
        "--sync-tolerance 2.5 --resize-truth --keep-corrupt -S 1.5 -E 2013-05-01T12:00:00Z "
        "--every 2 --max-frames 7 --record none --jobs 1"
    )
    assert main(words.split()) == 0
    outputs = (asked["save"], asked["reports"], asked["mcap"])
    assert outputs == (Path("out.rrd"), Path("out"), Path("o.mcap"))
    options = asked["options"]
    assert options.config.preset == "printed"
    assert options.config.stages["shadow"].ring_width == 3
    assert options.variants["narrow"].stages["shadow"].ring_width == 3
    assert options == ReplayOptions(
        config=options.config,
        variants=options.variants,
        model=Path("city.model"),
        image_topic="/image",
        truth_topic="/truth",
        shadow_topic="/shadow",
        mask_topics={"net": "/net"},
        road_labels=(3, 4),
        ignore_labels=(11,),
        start="1.5",
        end="2013-05-01T12:00:00Z",
        every=2,
        max_frames=7,
        sync_tolerance_ms=2.5,
        train_frames=5,
        train_gap=2,
        jobs=1,
        record="none",
        keep_corrupt=True,
        resize_truth=True,
    )


def test_the_result_goes_to_stdout_and_progress_to_stderr(asked, capsys):
    main(["replay", "drive.mcap"])
    shown = capsys.readouterr()
    assert "3 frames read" in shown.out
    assert shown.err == "replaying: 3 of 3 frames\n"


def test_json_is_the_summary_and_nothing_else(asked, capsys):
    main(["replay", "drive.mcap", "--json"])
    printed = json.loads(capsys.readouterr().out)
    assert printed.pop("format") == {"name": "roadeval-summary", "version": 1}
    assert printed == SUMMARY


def test_warnings_are_told_even_when_quiet(asked, capsys):
    asked["warnings"] = ("the classifier of filtered calls everything road",)
    assert main(["replay", "drive.mcap", "--quiet"]) == 0
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err == ("roadeval: warning: the classifier of filtered calls everything road\n")


def test_a_loss_is_told_and_has_its_exit_code(asked, capsys):
    asked["losses"] = ("frame 7: its JPEG ends early",)
    assert main(["replay", "drive.mcap", "--quiet"]) == 3
    assert capsys.readouterr().err == "roadeval: lost: frame 7: its JPEG ends early\n"


def test_a_configuration_that_cannot_be_used_is_a_known_problem(asked, capsys):
    assert main(["replay", "drive.mcap", "--config", "no-such.toml"]) == 1
    assert "no-such.toml" in capsys.readouterr().err
    assert "options" not in asked


def test_a_preset_alone_is_the_library_s():
    assert job.ReplayOptions().config == Config()


def test_the_truth_s_colours_arrive(asked):
    words = "replay d.mcap --road-color 64,32,32 --road-color 255,0,0 --ignore-color 1,2,3"
    assert main(words.split()) == 0
    assert asked["options"].road_colors == ((64, 32, 32), (255, 0, 0))
    assert asked["options"].ignore_colors == ((1, 2, 3),)


@pytest.mark.parametrize(
    "words",
    ["--road-color 1,2", "--road-color red", "--mask-topic net", "--mask-topic truth=/x"],
)
def test_colours_and_masks_are_checked_before_anything_is_opened(words, capsys):
    assert main(["replay", "drive.mcap", *words.split()]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_every_preset_can_be_asked_for():
    from roadeval.cli.options import PresetName
    from roadeval.config import PRESETS

    assert {name.value for name in PresetName} == set(PRESETS)
