"""Errors in metres, as a user asks for them: a file of the camera, tables, report, recording."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import roadeval
from roadeval.geometry.ground import ground_of
from roadeval.geometry.settings import GroundSettings
from tests.e2e.commands import here
from tests.e2e.test_fleet import Here
from tests.e2e.test_rig import IMAGE, SIZE, a_rig
from tests.recording.making import paths_of

CAMERA = "height = 1.42\npitch = 2.9\nfocal = [140]\n"
"""The demo's camera, for images a quarter as wide."""


@pytest.fixture(scope="module")
def metres(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("metres")
    a_rig(folder / "drive.mcap", {"front": (0, 24)})
    (folder / "camera.toml").write_text(CAMERA)
    words = "--camera", "camera.toml", "--save", "out.rrd", "-o", "out"
    run = here("replay", "drive.mcap", *words, cwd=folder)
    assert run.returncode == 0, run.stderr
    assert "Errors by distance, and on the ground" in run.stdout
    return folder


def test_errors_by_distance_are_those_of_the_pixels_there(metres: Path):
    ground, _ = ground_of(None, GroundSettings(height=1.42, pitch=2.9, focal=(140.0,)), SIZE)
    assert ground is not None
    columns, rows = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    pixels = np.column_stack([columns.ravel(), rows.ravel()]).astype(float)
    ahead = ground.places(pixels)[:, 0].reshape(SIZE[::-1])
    recording = roadeval.Recording(metres / "out.rrd")
    table = pd.read_csv(metres / "out" / "regions.csv")
    final = table[(table["variant"] == "filtered") & (table["stage"] == "post")]
    for frame in sorted(final["frame"].unique())[::7]:
        errors = recording.layer("filtered", "errors", frame)
        for name, near, far in (("0-10m", 0, 10), ("20-40m", 20, 40)):
            inside = errors[(near <= ahead) & (ahead < far)]
            (row,) = final[(final["frame"] == frame) & (final["region"] == name)].to_dict("records")
            counts = [np.sum(inside == code) for code in (1, 0, 2, 3)]
            assert [row[each] for each in ("TP", "TN", "FP", "FN")] == counts


def test_the_recording_has_the_ground_and_the_camera_over_it(metres: Path):
    paths = {*paths_of(metres / "out.rrd")}
    expected = {"/ground", "/ground/truth", "/ground/filtered", "/ground/unfiltered"}
    assert expected == {path for path in paths if path.startswith("/ground")}


def test_report_and_page_have_the_section(metres: Path):
    for name in ("out.pdf", "out.html"):
        assert here("report", "out.rrd", "-o", name, cwd=metres).returncode == 0
    text = (metres / "out.html").read_text()
    assert "On the ground, in metres" in text
    assert "from above" in text
    assert "camera 1.42 m above it, pitch 2.9" in text


def test_a_fleet_counts_by_distance_with_the_camera_of_each_drive(metres: Path):
    (metres / "drives.toml").write_text(
        '[[drives]]\npath = "drive.mcap"\nground = { height = 1.42, pitch = 2.9, fov = 59.49 }\n'
    )
    roadeval.replay_fleet([metres / "drives.toml"], metres / "fleet", executor=Here())
    scores = roadeval.Result(metres / "fleet").scores
    assert {"0-10m", "40-80m", "from_above"} <= {*scores["region"]}


def test_what_is_missing_for_metres_is_said(metres: Path):
    (metres / "height.toml").write_text("height = 1")
    run = here("info", "drive.mcap", "--camera", "height.toml", cwd=metres)
    assert "no metres: the focal length is missing" in run.stdout


def test_of_a_rig_each_camera_has_its_own_ground(tmp_path: Path):
    a_rig(tmp_path / "rig.mcap", {"front": (0, 14), "rear": (45, 59)})
    cameras = "\n".join(
        f'[[cameras]]\nname = "{name}"\nimage = "/{name}{IMAGE}"\n'
        f"ground = {{ height = {height}, pitch = 2.9, fov = 59.5 }}"
        for name, height in (("front", 1.42), ("rear", 2.5))
    )
    (tmp_path / "rig.toml").write_text(cameras)
    words = "--config", "rig.toml", "--save", "rig.rrd", "-o", "rig", "-q"
    run = here("replay", "rig.mcap", *words, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    facts = roadeval.Result(tmp_path / "rig").facts
    axes = {name: each.drive.ground.axes() for name, each in facts.cameras.items()}
    heights = {name: -(turn.T @ origin)[2] for name, (turn, origin) in axes.items()}
    assert heights == pytest.approx({"front": 1.42, "rear": 2.5})
    assert {*pd.read_csv(tmp_path / "rig" / "metres.csv")["camera"]} == {"front", "rear"}
    (tmp_path / "camera.toml").write_text(CAMERA)
    refused = here("replay", "rig.mcap", *words, "--camera", "camera.toml", cwd=tmp_path)
    assert refused.returncode != 0
    assert "which camera's?" in refused.stderr
