"""Several cameras of one log, scored apart and looked at as one drive; errors in metres."""

import json
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

import roadeval
from tests.e2e.commands import DEMO, here
from tests.e2e.test_fleet import Here
from tests.fixtures.logged import frames_in, jpeg, write_drive
from tests.recording.making import paths_of

IMAGE, TRUTH = "/camera/image", "/truth/road"
SIZE, ROAD = (160, 120), np.uint8(255)
NAMES = {f"/{name}{IMAGE}": None for name in ("front", "copy", "rear")}.keys()
TABLES = ("frames", "windows", "regions", "oracles", "changes", "heat", "disagreements")
"""Those of a drive that the two variants of the paper fill."""


@cache
def scenes() -> list[tuple[int, bytes, np.ndarray]]:
    """The demo's frames, a quarter as wide: stamp, JPEG and truth."""
    frames = frames_in(DEMO, frames={"max_frames": 69})
    small = [(cv2.resize(each.image, SIZE), cv2.resize(each.truth, SIZE)) for each in frames]
    return [
        (each.stamp_ns, jpeg(image), (truth == 1) * ROAD)
        for each, (image, truth) in zip(frames, small, strict=True)
    ]


def a_rig(path: Path, cameras: dict[str, tuple[int, int]], without: Iterable[str] = ()) -> Path:
    """A log in which each camera shows some frames of the demo, by their positions.

    Those of ``without`` have no labels.
    """

    def messages(place, image, truth):
        names = [name for name, (first, last) in cameras.items() if first <= place < last]
        labels = {f"/{name}{TRUTH}": truth for name in names if name not in without}
        return {f"/{name}{IMAGE}": image for name in names} | labels

    return write_drive(path, ((s, messages(n, *rest)) for n, (s, *rest) in enumerate(scenes())))


def topics(*cameras: str) -> list[str]:
    return [word for name in cameras for word in ("--image-topic", f"/{name}{IMAGE}")]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    a_rig(folder / "rig.mcap", {"front": (0, 26), "copy": (0, 26), "rear": (45, 69)})
    run = here("replay", "rig.mcap", *topics("front", "rear"), cwd=folder)
    assert run.returncode == 0, run.stderr
    (folder / "screen.txt").write_text(run.stdout)
    for name in ("front", "rear"):
        own = "replay", "rig.mcap", *topics(name), "--save", f"{name}.rrd", "-o", name, "-q"
        assert here(*own, cwd=folder).returncode == 0
    return folder


@pytest.mark.parametrize("camera", ["front", "rear"])
@pytest.mark.parametrize("table", TABLES)
def test_each_camera_has_the_rows_of_a_replay_of_it_alone(rig: Path, camera: str, table: str):
    both = [pd.read_csv(rig / own / f"{table}.csv") for own in ("reports/rig", camera)]
    together = both[0][both[0]["camera"] == f"/{camera}{IMAGE}"].reset_index(drop=True)
    assert len(together)
    pd.testing.assert_frame_equal(together, both[1])


@pytest.mark.parametrize("camera", ["front", "rear"])
def test_each_camera_has_the_layers_of_a_replay_of_it_alone(rig: Path, camera: str):
    of_rig = roadeval.Recording(rig / "recordings" / "rig.rrd", f"/{camera}{IMAGE}")
    alone = roadeval.Recording(rig / f"{camera}.rrd")
    assert of_rig.frame_numbers == alone.frame_numbers
    for frame in alone.frame_numbers[::8]:
        assert np.array_equal(of_rig.image(frame), alone.image(frame))
        for variant in alone.variants:
            for spec in variant.layers:
                layer = variant.name, spec.name, frame
                assert np.array_equal(of_rig.layer(*layer), alone.layer(*layer), equal_nan=True)
    for table in ("frames", "regions", "windows"):
        pd.testing.assert_frame_equal(of_rig.table(table), alone.table(table))
    assert of_rig.facts.totals == alone.facts.totals


def test_a_camera_that_is_there_twice_narrows_no_interval(rig: Path, tmp_path: Path):
    places = "--save", tmp_path / "two.rrd", "-o", tmp_path / "two", "-q"
    assert here("replay", rig / "rig.mcap", *topics("front", "copy"), *places).returncode == 0
    twice = json.loads((tmp_path / "two" / "summary.json").read_text())
    once = json.loads((rig / "front" / "summary.json").read_text())
    for part in ("difference", "against_blind"):
        for name, rates in once[part].items():
            for rate, alone in rates.items():
                both = twice[part][name][rate]
                assert both["units"] == 2 * alone["units"]
                for end in ("mean", "low", "high", "p", "effective"):
                    assert both[end] == pytest.approx(alone[end], rel=1e-9, abs=1e-12)
    assert twice["totals"]["filtered"]["post"]["ERR"] == pytest.approx(
        once["totals"]["filtered"]["post"]["ERR"]
    )


def test_reports_show_all_cameras_and_each(rig: Path):
    (folder := rig / "made").mkdir()
    for name in ("all.pdf", "all.html"):
        assert here("report", rig / "recordings/rig.rrd", "-o", folder / name).returncode == 0
    one = "report", rig / "recordings/rig.rrd", "--camera", "rear", "-o", folder / "one.html"
    assert here(*one).returncode == 0
    page = (folder / "all.html").read_text()
    assert all(f"Camera {name}" in page for name in ("front", "rear"))
    assert (folder / "all.pdf").read_bytes().startswith(b"%PDF")
    assert "rig, /rear/camera/image" in (folder / "one.html").read_text()


def test_worst_frames_of_all_cameras_are_recorded(rig: Path, tmp_path: Path):
    out = tmp_path / "worst.rrd"
    words = "--record", "worst:5", "--save", out, "-o", tmp_path / "r", "-q"
    assert here("replay", rig / "rig.mcap", *topics("front", "rear"), *words).returncode == 0
    kept = [roadeval.Recording(out, f"/{name}{IMAGE}").frame_numbers for name in ("front", "rear")]
    assert sum(map(len, kept)) == 5
    rows = roadeval.Result(out).frames.query("variant != 'blind' and stage == 'post'")
    worst = rows.groupby(["camera", "frame"])["ERR"].max().nlargest(5)
    assert {frame for _, frame in worst.index} == {n for own in kept for n in own}


@pytest.mark.parametrize("by_manifest", [True, False])
def test_the_cameras_of_a_log_are_drives_of_a_fleet_that_count_as_one(
    rig: Path, tmp_path: Path, *, by_manifest: bool
):
    images, drives = [f"/{name}{IMAGE}" for name in ("front", "copy")], rig / "rig.mcap"
    config = roadeval.configure({"cameras": [{"image": image} for image in images]})
    if by_manifest:
        entries = [f'[[drives]]\npath = "{drives}"\ntopics.image = "{name}"\n' for name in images]
        drives, config = tmp_path / "cameras.toml", None
        drives.write_text("".join(entries))
    roadeval.replay_fleet([drives], tmp_path / "fleet", config, executor=Here())
    fleet = roadeval.Result(tmp_path / "fleet")
    assert fleet.drives["name"].tolist() == ["rig front", "rig copy"]
    whole = pd.read_parquet(tmp_path / "fleet" / "frames")
    assert whole.groupby("drive").size().tolist() == [len(whole) // 2] * 2
    (effect,) = [
        e.rates["ERR"]
        for e in fleet.facts.effects
        if (e.base, e.variant) == ("unfiltered", "filtered")
    ]
    assert (effect.units, effect.groups, effect.low) == (2, 1, None)
    assert any("averaged to one drive" in warning for warning in fleet.facts.warnings)


def test_a_camera_without_labels_is_recorded_and_says_why(rig: Path, tmp_path: Path):
    log = a_rig(tmp_path / "half.mcap", {"front": (0, 30), "rear": (0, 30)}, without={"rear"})
    places = "--save", tmp_path / "o.rrd", "-o", tmp_path / "o"
    run = here("replay", log, *topics("front", "rear"), *places)
    assert run.returncode == 0, run.stderr
    assert "belongs to another camera" in run.stderr
    summary = json.loads((tmp_path / "o" / "summary.json").read_text())
    assert [bool(own["totals"]) for own in summary["cameras"].values()] == [True, False]
    assert summary["totals"] == summary["cameras"][f"/front{IMAGE}"]["totals"]
    alone = roadeval.Recording(tmp_path / "o.rrd", f"/rear{IMAGE}")
    assert alone.layer("unfiltered", "post", frame=5).any()
    assert here("report", tmp_path / "o.rrd", "-o", tmp_path / "o.pdf").returncode == 0
    listed = here("inspect", tmp_path / "o.rrd", "--list", "--json")
    assert {frame["camera"] for frame in json.loads(listed.stdout)} == {f"/front{IMAGE}"}
    assert here("inspect", tmp_path / "o.rrd", "--list").returncode == 0


def test_errors_are_filmed_before_the_doubt_of_a_camera_without_labels(rig: Path, tmp_path: Path):
    log = a_rig(tmp_path / "half.mcap", {"rear": (0, 30), "front": (0, 30)}, without={"rear"})
    places = "--save", tmp_path / "o.rrd", "-o", tmp_path / "o", "-q"
    assert here("replay", log, *topics("rear", "front"), *places).returncode == 0
    films, _ = roadeval.clip(tmp_path / "o.rrd", tmp_path / "clips", worst=9)
    cameras = ["front" if "front" in film.name else "rear" for film in films]
    assert cameras == sorted(cameras)
    assert {*cameras} == {"front", "rear"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--truth-topic", "/front/truth/road"), "belongs to one of several cameras"),
        (("--truth", "labels"), "belong to one camera"),
        (topics("front"), "given twice"),
    ],
)
def test_what_does_not_say_which_camera_is_refused(rig: Path, words: list[str], said: str):
    run = here("replay", rig / "rig.mcap", *topics("front", "rear"), *words, "-q")
    assert run.returncode in (1, 2)
    assert said in run.stderr


def test_a_camera_whose_topic_cannot_be_shown_is_read_back(tmp_path: Path):
    name = "cam\x1b[31m,\n"
    a_rig(tmp_path / "a.mcap", {name: (0, 24), "rear": (0, 24)})
    cameras = [{"image": f"/{name}{IMAGE}"}, {"image": f"/rear{IMAGE}"}]
    config = roadeval.configure({"cameras": cameras})
    roadeval.replay(tmp_path / "a.mcap", config, save=tmp_path / "o.rrd", reports=tmp_path / "o")
    shown = r"/cam\u001b[31m,\n/camera/image"
    for path in ("o.rrd", "o"):
        result = roadeval.Result(tmp_path / path)
        assert set(result.frames["camera"]) == {shown, f"/rear{IMAGE}"}
        assert list(result.cameras) == [shown, f"/rear{IMAGE}"]
        for camera, own in result.cameras.items():
            assert set(own.frames["camera"]) == {camera}


def test_a_command_that_looks_at_one_camera_takes_no_second(rig: Path):
    run = here("info", rig / "rig.mcap", *topics("front", "rear"))
    assert run.returncode == 2
    assert "one camera at a time" in run.stderr


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
    """The camera is 1.42 m above the ground, pitched by 2.9 degrees, with a focal length of 140."""
    pitch, y = np.radians(2.9), (np.arange(SIZE[1]) - (SIZE[1] - 1) / 2) / 140
    down, forward = np.sin(pitch) + y * np.cos(pitch), np.cos(pitch) - y * np.sin(pitch)
    ahead = np.where(down > 0, 1.42 * forward / down, np.nan)
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
    assert "belongs to one of several cameras" in refused.stderr
