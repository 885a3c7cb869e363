"""A method of one's own in a run: tables, frames that it loses, models, and recordings."""

import hashlib
import importlib
import sys
from pathlib import Path

import pandas as pd
import pytest

import roadeval
from roadeval.cli.app import main
from roadeval.jobs.run.prepared import settings_digest
from roadeval.pipeline import stages
from tests.jobs.making import settings, write_log
from tests.pipeline import somebody


def somebodys(name):
    return {"chain": [f"tests.pipeline.somebody:{name}", "post"]}


def line_of(text):
    """The line of the one place in the methods' file that has a text."""
    lines = Path(somebody.__file__).read_text().splitlines()
    (found,) = (number for number, line in enumerate(lines, 1) if text in line)
    return found


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("log") / "drive.mcap")


def run(drive, to, **values):
    return roadeval.replay(drive, settings(**values), save=to / "o.rrd", reports=to / "reports")


def test_it_stands_in_tables_and_recording(drive, tmp_path):
    run(drive, tmp_path, variants={"mine": somebodys("LEARNS")})
    rows = pd.read_csv(tmp_path / "reports" / "frames.csv").query("variant == 'mine'")
    assert set(rows.stage) == {"bright", "post"}
    assert rows.ERR.max() < 0.05
    assert roadeval.Recording(tmp_path / "o.rrd").layer("mine", "level", 15).shape


def test_a_frame_on_which_it_fails_is_lost_and_the_rest_is_scored(drive, tmp_path):
    outcome = run(drive, tmp_path, variants={"mine": somebodys("fails_on_13")})
    assert outcome.losses == (
        "frame 13: variant mine: stage fails_on_13 failed: ZeroDivisionError: no road "
        f"(somebody.py:{line_of('ZeroDivisionError')})",
    )
    frames = outcome.summary["frames"]
    assert frames["evaluated"] == 14
    assert frames["skipped"]["failed in a stage"] == 1
    assert frames["evaluated"] + sum(frames["skipped"].values()) == frames["in_log"]
    assert len(outcome.tracebacks) == 1
    assert "somebody.py" in outcome.tracebacks[0]


def test_where_the_first_frames_all_fail_the_run_ends(drive, tmp_path):
    variants = {"mine": somebodys("always_fails"), "fine": somebodys("lower_half")}
    with pytest.raises(roadeval.RoadevalError) as caught:
        run(drive, tmp_path, variants=variants)
    assert str(caught.value) == (
        "variant mine: stage always_fails failed: KeyError: 'weights' "
        f"(somebody.py:{line_of('KeyError')}), on each of the first 10 frames (10 to 19); mend it, "
        "or leave the variant out with `only` filtered `only` unfiltered `only` fine"
    )
    assert "in always_fails" in str(caught.value.__cause__)


def test_one_that_cannot_learn_is_named(drive, tmp_path):
    with pytest.raises(roadeval.RoadevalError, match="stage unfit cannot learn: ValueError"):
        run(drive, tmp_path, variants={"mine": somebodys("UNFIT")})


def test_what_it_learns_stands_in_a_model_file(drive, tmp_path):
    path, variants = tmp_path / "m.model", {"mine": somebodys("LEARNS")}
    config = settings(variants=variants, train_frames=4)
    model = roadeval.train([drive], path, config)
    outcome = run(drive, tmp_path, variants=variants, model=path)
    assert outcome.summary["totals"]["mine"]["post"]["ERR"] < 0.05
    with pytest.raises(roadeval.RoadevalError, match="mine/bright is no stage that learns"):
        roadeval.load_model(path)  # a file by itself loads nobody's code
    own = config.pipelines()["mine"].stages()
    assert roadeval.load_model(path, own).parameters["mine"] == model.parameters["mine"]


def test_results_tell_the_code_and_are_known_by_it(drive, tmp_path, monkeypatch):
    outcome = run(drive, tmp_path, variants={"mine": somebodys("lower_half")})
    told = outcome.summary["methods"]["mine"]["lower_half"]
    assert told["stage"] == "tests.pipeline.somebody:lower_half"
    assert told["sha256"] == hashlib.sha256(Path(somebody.__file__).read_bytes()).hexdigest()

    def known_by(text):
        stages.import_stage.cache_clear()
        (tmp_path / "changing.py").write_text(text)
        sys.modules.pop("changing", None)
        importlib.invalidate_caches()
        return settings_digest(settings(chain=["changing:road", "post"]), "")

    monkeypatch.syspath_prepend(tmp_path)
    one = "def road(image): return image[..., 0] > 1\n"
    other = "def road(image): return image[..., 0] > 20\n"
    assert known_by(one) == known_by(one) != known_by(other)


def test_a_recording_loads_no_code(drive, tmp_path):
    run(drive, tmp_path, variants={"mine": somebodys("lower_half")})
    with pytest.raises(roadeval.RoadevalError, match="which is loaded only from a"):
        roadeval.load_config(tmp_path / "o.rrd")
    again = roadeval.load_config(tmp_path / "reports" / "run.toml")
    assert "mine" in again.pipelines()


@pytest.mark.parametrize("debug", ["0", "1"])
def test_its_traceback_is_shown_where_it_is_asked_for(debug, drive, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ROADEVAL_DEBUG", debug)
    (tmp_path / "mine.toml").write_text('chain = ["tests.pipeline.somebody:fails_on_13", "post"]\n')
    words = ("--variant", f"mine={tmp_path / 'mine.toml'}", "--reports", tmp_path / "reports")
    assert main(["replay", str(drive), "-q", "--record", "none", *map(str, words)]) == 3
    said = capsys.readouterr().err
    assert "roadeval: lost: frame 13: variant mine: stage fails_on_13 failed" in said
    assert ("Traceback" in said) == (debug == "1")
