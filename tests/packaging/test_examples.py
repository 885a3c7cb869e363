"""The scripts in examples/ run as they stand."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from pypdf import PdfReader

import roadeval
from tests.golden import drive

ROOT = Path(__file__).resolve().parents[2]


def test_the_tour_of_the_api_runs(tmp_path):
    (tmp_path / "recordings").mkdir()
    drive.write(tmp_path / "recordings" / "demo.mcap")
    run = subprocess.run(
        [sys.executable, ROOT / "examples" / "api.py"],
        cwd=tmp_path,
        env=os.environ | {"MPLBACKEND": "agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert "filtered   ERR of the final mask: " in run.stdout
    assert "svm" in run.stdout
    out = tmp_path / "reports" / "api"
    wanted = {"demo.rrd", "frames.csv", "errors.png", "layers.png", "demo.model"}
    assert wanted <= {path.name for path in out.iterdir()}


def test_the_example_method_is_installed_and_replayed_by_its_entry_point(tmp_path):
    pytest.importorskip("setuptools", minversion="77", reason="builds the example")
    shutil.copytree(ROOT / "examples" / "method", tmp_path / "method")  # a build leaves files
    _run("-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--no-index",
         "--target", tmp_path / "site", tmp_path / "method")  # fmt: skip
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "site")}
    log = drive.write(tmp_path / "drive.mcap", frames=14)
    _run("-m", "roadeval", "replay", log, "--variant", f"mine={tmp_path / 'method/smooth.toml'}",
         "--train-frames", "4", "--save", "out.rrd", "--reports", "reports",
         cwd=tmp_path, env=environment)  # fmt: skip
    rows = pd.read_csv(tmp_path / "reports" / "frames.csv").query("variant == 'mine'")
    assert set(rows.stage) == {"smooth", "post"}
    assert roadeval.Recording(tmp_path / "out.rrd").layer("mine", "texture", 11).any()
    pages = PdfReader(roadeval.write_report(tmp_path / "out.rrd", tmp_path / "report.pdf")).pages
    assert any("smooth" in page.extract_text() for page in pages)


def _run(*words, **options):
    done = subprocess.run(
        [sys.executable, *map(str, words)], capture_output=True, text=True, check=False, **options
    )
    assert done.returncode == 0, done.stderr
