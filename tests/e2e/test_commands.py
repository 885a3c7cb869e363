"""The other commands, and what scripts rely on."""

import json
import re

from tests.e2e.commands import here, roadeval
from tests.fixtures.make import make


def flowing(text):
    return " ".join(text.split())


def test_json_prints_the_summary_and_nothing_else(at_home):
    run, folder = at_home
    assert run.stdout == (folder / "reports" / "street" / "summary.json").read_text()
    assert json.loads(run.stdout)["frames"]["evaluated"] == 20


def test_a_model_is_never_evaluated_on_the_frames_that_trained_it(tmp_path):
    drive, model, first = make("drives/car_park.mcap", tmp_path), tmp_path / "x.model", ("--end", 1)
    trained = roadeval("train", drive, "-o", model, "--train-frames", 4, *first)
    assert trained.returncode == 0, trained.stderr
    assert f"{model}: filtered, unfiltered; trained on 4 frames" in trained.stdout
    run = here("replay", drive, "--model", model, "--record", "none", *first, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert re.search(r"6 of \d+ frames were evaluated, .*, 4 to train on\.", flowing(run.stdout))
    assert not list(tmp_path.rglob("*.rrd"))
