"""The command ``replay``: what it hands to the main job, and what it makes of the outcome."""

import pytest

from roadeval import RunConfig, configure
from roadeval.cli.app import main
from roadeval.cli.options import OPTIONS, with_flags
from roadeval.jobs.progress import Progress
from roadeval.jobs.run.replay import Outcome
from roadeval.results.facts import DriveFacts, FrameAccount
from roadeval.runtime.sentence import Sentence, Setting
from tests.results.making import facts_of

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
