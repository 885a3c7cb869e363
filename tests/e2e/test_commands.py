"""The other commands, and what scripts rely on."""

import json
import subprocess

from tests.e2e.commands import DEMO, ROADEVAL, roadeval


def test_json_prints_the_summary_and_nothing_else(tmp_path):
    outputs = ("--save", tmp_path / "out.rrd", "--reports", tmp_path / "reports")
    run = roadeval("replay", DEMO, "--json", "--max-frames", 15, *outputs)
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout) == json.loads((tmp_path / "reports/summary.json").read_text())


def test_outputs_land_in_recordings_and_reports_of_the_current_folder(tmp_path):
    run = subprocess.run(
        [ROADEVAL, "replay", DEMO, "--max-frames", "12", "--quiet"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout == ""
    assert (tmp_path / "recordings" / "demo.rrd").is_file()
    assert (tmp_path / "reports" / "demo" / "summary.json").is_file()


def test_a_model_trained_on_a_drive_is_never_evaluated_on_its_own_frames(tmp_path):
    model, reports = tmp_path / "demo.model", tmp_path / "reports"
    trained = roadeval("train", DEMO, "-o", model, "--train-frames", 4)
    assert trained.returncode == 0, trained.stderr
    assert f"{model}: filtered, unfiltered; trained on 4 frames" in trained.stdout
    outputs = ("--save", tmp_path / "out.rrd", "--reports", reports)
    run = roadeval("replay", DEMO, "--model", model, "--record", "none", *outputs)
    assert run.returncode == 0, run.stderr
    frames = json.loads((reports / "summary.json").read_text())["frames"]
    assert (frames["trained_on"], frames["evaluated"]) == (4, 96)
    assert not (tmp_path / "out.rrd").exists()


def test_info_tells_what_replay_would_pick():
    run = roadeval("info", DEMO)
    assert run.returncode == 0, run.stderr
    assert "replay would pick" in run.stdout
    assert "640x480" in run.stdout
