"""Results compared, and opened as one: from fleets' folders and from what single drives left."""

import re
import shutil
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import cv2
import numpy as np
import pandas as pd
import pytest

import roadeval
from roadeval import RoadevalError, compare, replay, replay_fleet
from tests.e2e.test_fleet import Here
from tests.jobs.making import FRAMES, PIXELS, settings, write_log, write_module
from tests.results.fleet.making import fleet_of
from tests.training.making import frame


@pytest.fixture(scope="module")
def fleets(tmp_path_factory):
    """A fleet of eight scored drives among ten, and one whose every third drive is worse."""
    folder = tmp_path_factory.mktemp("fleets")
    return fleet_of(folder / "base", 10), fleet_of(folder / "new", 10, change=0.03)


@pytest.fixture(scope="module")
def compared(fleets):
    return compare(fleets)


def test_the_drives_that_are_worse_are_found_and_no_others(compared):
    found = compared.comparison
    assert {change.drives for change in found.changes} == {8}
    changed = {(row.variant, row.drive) for row in found.drives if row.changed}
    assert changed == {("filtered", f"drive_000{place}") for place in (0, 3, 6)}
    assert found.warnings == (
        "base: 1 of 10 drives failed and is in no number: drive_0007",
        "new: 1 of 10 drives failed and is in no number: drive_0007",
        "2 drives are left out of base (not scored in both): drive_0007, drive_0009",
    )
    assert compared.sides == ()


def test_a_comparison_that_lasts_tells_how_many_drives_are_done(fleets, monkeypatch):
    told = []
    compare(fleets, on_progress=told.append)
    assert told == []
    monkeypatch.setattr("roadeval.jobs.results.compare.SILENT_S", -1.0)
    monkeypatch.setattr("roadeval.evaluation.comparison.compare.FRAMES", 80)
    compare(fleets, on_progress=told.append)
    assert [progress.done for progress in told] == [0, 4, 8, 12]
    assert {(progress.total, progress.stage) for progress in told} == {(16, "comparing")}


def test_drives_that_the_base_lacks_may_be_read_apart(fleets, tmp_path, monkeypatch):
    pair = fleet_of(tmp_path / "base", 2), fleets[1]
    together = compare(pair).content
    monkeypatch.setattr("roadeval.evaluation.comparison.compare.FRAMES", 1)
    assert compare(pair).content == together
    assert "drives are left out of new (not in base)" in str(together["warnings"])


def test_a_method_whose_code_has_changed_is_named(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    drive = write_log(tmp_path / "drive.mcap")
    for name, least in (("base", 100), ("new", 120)):
        code = f"def road(image):\n    return image.mean(axis=2) > {least}\n"
        write_module(tmp_path / "greyroad.py", code)
        config = settings(variants={"grey": {"chain": ["greyroad:road", "post"]}}, only=["grey"])
        replay(drive, config, save=tmp_path / f"{name}.rrd", reports=tmp_path / name)
        replay_fleet([drive], tmp_path / f"fleet_{name}", config, executor=Here())
    for base, new in (("base.rrd", "new"), ("fleet_base", "fleet_new")):
        (changed,) = compare([tmp_path / base, tmp_path / new]).content["changed"]
        said = r"Changed settings: code of grey \(greyroad:road\) \w{8} to \w{8}\."
        assert re.fullmatch(said, changed)


def replay_with_labels(folder, move):
    """Replay a drive whose labels lie beside it, moved; return the folder of its results."""
    drive = write_log(folder / "drive.mcap", truth=False)
    (folder / "labels").mkdir()
    for number in range(FRAMES):
        truth = 255 * frame(number).truth
        truth[:, :5] = 0
        cv2.imwrite(str(folder / "labels" / f"{number}.png"), move(truth))
    labels = {"path": str(folder / "labels")}
    tables = {"output": {"record": "none"}, "training": {"pixels_per_class": PIXELS}}
    config = roadeval.configure({"truth": labels, "only": ["filtered"], **tables})
    replay(drive, config, reports=folder / "reports")
    return folder / "reports"


@pytest.fixture(scope="module")
def unmoved(tmp_path_factory):
    return replay_with_labels(tmp_path_factory.mktemp("unmoved"), lambda truth: truth)


@pytest.mark.parametrize(
    ("moved", "frames"),
    [
        (lambda truth: np.roll(truth, 3, axis=1), 16),
        (lambda truth: truth[:, ::-1], 16),
        (lambda truth: truth[::-1], 16),
        (lambda truth: truth, 0),
    ],
    ids=["3 columns to the right", "mirrored", "upside down", "as it was"],
)
def test_labels_that_moved_are_told_and_no_change_is_judged(unmoved, tmp_path, moved, frames):
    """A move and a mirror leave the number of road pixels as it was."""
    limits = ["post.filtered.ERR > 1pp", "post.filtered.ERR > 99%"]
    found = compare([unmoved, replay_with_labels(tmp_path, moved)], fail_if=limits)
    told = [each for each in found.comparison.warnings if "the truth differs" in each]
    assert [each.partition(" between")[0] for each in told] == [
        f"the truth differs on {frames} frames"
    ] * bool(frames)
    assert sum(j.holds is None for j in found.judgements) == bool(frames)


def test_a_drive_whose_frames_have_gone_is_named(fleets, tmp_path):
    cut = shutil.copytree(fleets[1], tmp_path / "cut")
    path = min((cut / "frames").glob("drive_0000*/frames.parquet"))
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(RoadevalError, match=r"frames\.parquet: damaged"):
        compare([fleets[0], cut])
    path.unlink()
    with pytest.raises(RoadevalError, match=r"frames\.parquet: is not there"):
        compare([fleets[0], cut])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A drive that was replayed by itself, and as a fleet of one."""
    folder = tmp_path_factory.mktemp("made")
    drive, config = write_log(folder / "small.mcap"), settings(jobs=1)
    alone = folder / "alone"
    roadeval.replay(drive, config, save=folder / "out.rrd", reports=alone)
    with ThreadPoolExecutor(1) as executor:
        many = roadeval.replay_fleet(drive, folder / "many", config, executor=executor).folder
    return SimpleNamespace(alone=alone, recording=folder / "out.rrd", many=many)


@pytest.mark.parametrize("table", ["drives", "scores", "effects"])
def test_a_drive_is_a_fleet_of_one(made, table):
    mine, fleets = (
        getattr(roadeval.Result(path), table).drop(columns="drive")
        for path in (made.alone, made.many)
    )
    assert len(mine) == len(fleets) > 0
    for column in mine.columns.intersection(fleets.columns):
        if table == "drives" and column not in ("in_log", "evaluated", "status", "width", "camera"):
            continue
        if pd.api.types.is_numeric_dtype(fleets[column]):
            own = mine[column].astype(float)
            np.testing.assert_array_equal(own, fleets[column].astype(float), err_msg=column)
        else:
            assert mine[column].tolist() == fleets[column].tolist()


def test_a_recording_and_the_folder_beside_it_hold_the_same(made):
    for table in ("scores", "effects", "frames"):
        one, other = (
            getattr(roadeval.Result(path), table) for path in (made.alone, made.recording)
        )
        pd.testing.assert_frame_equal(one, other)


@pytest.mark.parametrize("table", ["frames", "regions"])
@pytest.mark.parametrize("kind", ["alone", "recording", "many"])
def test_the_rows_of_final_masks_are_those_of_the_whole_table(made, kind, table):
    result = roadeval.Result(getattr(made, kind))
    whole = result.table(table)
    expected = whole[whole["stage"] == "post"].reset_index(drop=True)
    assert len(expected)
    rows = result.table(table, final=True).reset_index(drop=True)
    pd.testing.assert_frame_equal(rows, expected, check_categorical=False)


def test_a_result_named_twice_and_a_table_that_does_not_exist_are_refused(made):
    with pytest.raises(roadeval.RoadevalError) as twice:
        roadeval.Result(made.alone, made.many, made.alone / ".." / made.alone.name)
    assert (twice.value.where, twice.value.problem) == (str(made.alone), "it is named twice")
    with pytest.raises(roadeval.RoadevalError) as unknown:
        roadeval.Result(made.alone).table("frame")
    assert unknown.value.problem == "there is no table frame"
    assert unknown.value.remedy.startswith("did you mean frames? the tables are: frames, ")


def test_several_results_are_one_table_with_their_drives(made):
    both = roadeval.Result(made.alone, made.many)
    assert len({*both.scores["drive"]}) == len(both.compared) == len(both.drives) == 2
    one, other = both.frames.groupby("drive").ERR.mean()
    assert one == other
    assert roadeval.Result(made.recording).recording == made.recording
    assert roadeval.Result(made.recording, made.alone).recording is None
