"""The scripts in examples/, the examples of docstrings and the form of findings/."""

import doctest
import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path

import pandas as pd
import pytest

import roadeval
from tests.golden import drive

ROOT = Path(__file__).resolve().parents[2]


def test_the_tour_of_the_api_runs(tmp_path, monkeypatch, capsys):
    (tmp_path / "recordings").mkdir()
    drive.write(tmp_path / "recordings" / "demo.mcap", frames=21)
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "examples" / "api.py"), run_name="__main__")
    printed = capsys.readouterr().out
    assert "filtered   ERR of the final mask: " in printed
    assert "svm" in printed
    out = tmp_path / "reports" / "api"
    wanted = {"demo.rrd", "frames.csv", "errors.png", "layers.png", "demo.model"}
    assert wanted <= {path.name for path in out.iterdir()}


@pytest.mark.sweep
def test_the_example_package_is_installed_and_used_by_its_entry_points(tmp_path):
    pytest.importorskip("setuptools", minversion="77", reason="builds the example")
    shutil.copytree(ROOT / "examples" / "method", tmp_path / "method")  # a build leaves files
    _run("-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--no-index",
         "--target", tmp_path / "site", tmp_path / "method")  # fmt: skip
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "site")}
    log = drive.write(tmp_path / "drive.mcap", frames=14)
    (tmp_path / "plain.toml").write_text("training.frames = 4\noutput.figures = false\n")
    corners = [[0, 47], [20, 20], [44, 20], [63, 47]]
    outlines = {"road_of": {f"frame_{number:06}": corners for number in range(14)}}
    (tmp_path / "outlines.json").write_text(json.dumps(outlines))
    _run("-m", "roadeval", "replay", log, "--variant", f"mine={tmp_path / 'method/smooth.toml'}",
         "--truth", "outlines.json", "--disturb", "fade:0.5",
         "--config", "plain.toml", "--save", "out.rrd", "--reports", "reports",
         cwd=tmp_path, env=environment)  # fmt: skip
    summary = json.loads((tmp_path / "reports" / "summary.json").read_text())
    final = summary["totals"]["mine"]["post"]
    assert final["pooled_caution"] == final["FP"] / (final["TP"] + final["FP"])
    columns = pd.read_csv(tmp_path / "reports" / "frames.csv").columns
    assert "caution" not in columns  # tables are the same with and without the package
    assert "fade-0_5" in summary["disturbances"]["mine"]
    assert summary["versions"]["smooth-road"] == "1.0"
    regions = pd.read_csv(tmp_path / "reports" / "regions.csv")
    assert "middle" in set(regions.region)
    _run("-m", "roadeval", "report", "out.rrd", "-o", "without.html", cwd=tmp_path)
    rows = pd.read_csv(tmp_path / "reports" / "frames.csv").query("variant == 'mine'")
    assert set(rows.stage) == {"smooth", "post"}
    assert roadeval.Recording(tmp_path / "out.rrd").layer("mine", "texture", 11).any()


def _run(*words, **options):
    done = subprocess.run(
        [sys.executable, *map(str, words)], capture_output=True, text=True, check=False, **options
    )
    assert done.returncode == 0, done.stderr


HOME = Path(roadeval.__file__).parent
SOURCES = {path: path.read_text() for path in sorted(HOME.rglob("*.py"))}
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def name_of(path: Path) -> str:
    parts = path.relative_to(HOME.parent).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


MODULES = [name_of(path) for path, text in SOURCES.items() if ">>> " in text]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """What examples speak of: a drive, its recording, a model, and a fleet of that drive."""
    folder = tmp_path_factory.mktemp("examples")
    drive.write(folder / "drive.mcap", frames=14)
    reports = folder / "reports"
    roadeval.replay(folder / "drive.mcap", save=folder / "out.rrd", reports=reports)
    roadeval.train([folder / "drive.mcap"], folder / "city.model")
    with ThreadPoolExecutor(1) as pool:
        roadeval.replay_fleet([folder / "drive.mcap"], folder / "monday", executor=pool)
    return folder


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_run(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    found = doctest.testmod(import_module(name), optionflags=OPTIONS)
    assert found.attempted
    assert not found.failed


def test_no_example_is_skipped():
    assert not [name_of(path) for path, text in SOURCES.items() if "doctest: +SKIP" in text]


FINDINGS = sorted((Path(__file__).resolve().parents[2] / "findings").iterdir())


@pytest.mark.parametrize("path", FINDINGS, ids=[path.stem for path in FINDINGS])
def test_a_finding_installs_pinned_packages_in_a_folder_that_it_removes(path):
    assert path.suffix == ".sh"
    text = path.read_text()
    header, _, script = text.partition("set -euo pipefail\n")
    assert header.startswith("#!/usr/bin/env bash\n# ")
    assert all(f"# {word}: " in header for word in ("Software", "Source"))
    assert script.startswith("folder=$(mktemp -d)\ntrap 'rm -rf \"$folder\"' EXIT\n")
    assert "python3 -m venv" in script
    command = re.search(r"/pip\" install (.*?[^\\])\n", script, re.DOTALL)
    packages = [word for word in command[1].split() if word[0] not in "-\\"]
    assert packages
    assert all("==" in package for package in packages)
    assert "roadeval" not in text
    assert not subprocess.run(["bash", "-n", path], check=False).returncode
