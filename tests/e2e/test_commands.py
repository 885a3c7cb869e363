"""The other commands, and what scripts rely on."""

import json
import re

import pytest

from tests.e2e.commands import here, replay, roadeval
from tests.fixtures.make import make


def flowing(text):
    return " ".join(text.split())


def test_outputs_land_in_recordings_and_reports_of_the_current_folder(at_home):
    run, folder = at_home
    assert run.returncode == 0, run.stderr
    assert (folder / "recordings" / "street.rrd").is_file()
    assert (folder / "reports" / "street" / "summary.json").is_file()


def test_json_prints_the_summary_and_nothing_else(at_home):
    run, folder = at_home
    assert run.stdout == (folder / "reports" / "street" / "summary.json").read_text()
    assert json.loads(run.stdout)["frames"]["evaluated"] == 20


@pytest.mark.parametrize(
    ("condition", "code", "said"),
    [
        ("post.filtered.ERR > 0%", 4, "post.filtered.ERR > 0% holds"),
        ("svm.unfiltered.ERR > 99%", 0, ""),
        ("post.filtered.ERR > +0.5pp", 1, "has no base to have changed from"),
        ("post.net.ERR > 1%", 1, "nothing scored is called post.net; there are post.blind"),
    ],
)
def test_a_replay_fails_where_a_condition_on_its_rates_holds(condition, code, said, tmp_path):
    run = replay(tmp_path, make("drives/car_park.mcap", tmp_path), "--fail-if", condition).run
    assert run.returncode == code, run.stderr
    assert said in run.stderr
    # A change needs a base: that is said before anything is replayed.
    assert (tmp_path / "out.rrd").exists() == ("pp" not in condition)


def test_a_replay_with_limits_appends_them_to_the_summary_of_a_job(tmp_path, monkeypatch):
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary.md"))
    drive = make("drives/car_park.mcap", tmp_path)
    limits = ("post.filtered.ERR > 0%", "svm.unfiltered.ERR > 99%")
    done = replay(tmp_path, drive, *(word for each in limits for word in ("--fail-if", each)))
    title, _, *rest = (tmp_path / "summary.md").read_text().splitlines()
    assert title == "## roadeval: failed, 1 of 2 limits exceeded"
    assert [line for line in rest if line.startswith("**")] == [
        "**Limits exceeded**",
        "**Limits kept**",
    ]
    assert done.summary["verdict"].split(";")[0] in rest[-1]


def test_a_condition_with_too_few_frames_behind_it_is_not_judged(tmp_path):
    drive = make("drives/car_park.mcap", tmp_path)
    words = ("--max-frames", 15, "--fail-if", "post.filtered.ERR > 99%")
    run = replay(tmp_path, drive, *words).run
    assert run.returncode == 1
    assert "not judged, because car_park has 5 evaluated frames, and 10 are needed" in run.stderr


def test_without_truth_one_line_says_that_no_condition_can_be_checked(tmp_path):
    drive = make("drives/unlabelled.mcap", tmp_path)
    limits = ("post.filtered.ERR > 0%", "svm.unfiltered.ERR > 99%")
    run = replay(tmp_path, drive, *(word for each in limits for word in ("--fail-if", each))).run
    assert run.returncode == 1
    assert "Nothing to score: " in run.stdout
    (line,) = (each for each in run.stderr.splitlines() if "error" in each)
    assert line == (
        f"roadeval: error: {', '.join(limits)}: nothing can be checked, for no frame with truth "
        "was evaluated"
    )


def test_a_model_is_never_evaluated_on_the_frames_that_trained_it(tmp_path):
    drive, model, first = make("drives/car_park.mcap", tmp_path), tmp_path / "x.model", ("--end", 1)
    trained = roadeval("train", drive, "-o", model, "--train-frames", 4, *first)
    assert trained.returncode == 0, trained.stderr
    assert f"{model}: filtered, unfiltered; trained on 4 frames" in trained.stdout
    run = here("replay", drive, "--model", model, "--record", "none", *first, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert re.search(r"6 of \d+ frames were evaluated, .*, 4 to train on\.", flowing(run.stdout))
    assert not list(tmp_path.rglob("*.rrd"))
