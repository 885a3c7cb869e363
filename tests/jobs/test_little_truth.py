"""Few labels, or none, that lie beside the log."""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
import pytest

import roadeval
from roadeval import RoadevalError
from tests.e2e.commands import here
from tests.e2e.test_fleet import Here
from tests.fixtures.logged import frames_in, write_drive
from tests.jobs.making import FRAMES, write_log

TABLES = ("frames", "windows", "regions")


@pytest.fixture(scope="module")
def places(tmp_path_factory) -> Path:
    """A log without truth, its truth in folders of many and of few labels, and masks to score."""
    base = tmp_path_factory.mktemp("places")
    whole = write_log(base / "whole.mcap", net=True)
    for name in ("26", "21", "6", "net"):
        (base / name).mkdir()
    frames = frames_in(whole, topics={"masks": {"net": "/net/road_mask_prediction"}})
    images = ((frame.stamp_ns, {"/camera/image": bytes(frame.payload)}) for frame in frames)
    write_drive(base / "drive.mcap", images)
    for frame in frames:
        name = f"{frame.number}.png"
        rolled = np.roll(frame.external["net"], frame.number % 5 - 2, 0)
        cv2.imwrite(str(base / "net" / name), rolled * 255)
        if frame.truth is not None:
            own = {"26": True, "21": frame.number < 22, "6": frame.number % 4 == 1}
            for folder in (each for each in own if own[each]):
                cv2.imwrite(str(base / folder / name), frame.truth * 255)
    for number in (1, 5, 9, 13, 17, 21, 25):
        assert (base / "6" / f"{number}.png").exists()
    (base / "6" / "25.png").unlink()
    assert len([*(base / "21").iterdir()]) == 21
    assert len([*(base / "6").iterdir()]) == 6
    return base


def replay(places: Path, out: Path, truth: str = "", only: tuple[str, ...] = (), **tables: Any):
    config = roadeval.configure(
        {
            "masks": {"net": {"path": str(places / "net")}},
            "only": list(only),
            "truth": {"path": str(places / truth), "first": 0} if truth else {},
            "output": {"record": "none"},
        }
        | tables
    )
    return roadeval.replay(places / "drive.mcap", config, reports=out)


def tables(folder: Path) -> dict[str, str]:
    return {name: (folder / f"{name}.csv").read_text() for name in TABLES}


def test_masks_alone_learn_nothing_and_are_scored_on_every_label(places, tmp_path):
    done = replay(places, tmp_path, "6", ("net",))
    assert done.summary["frames"]["evaluated"] == 6
    assert done.summary["frames"]["trained_on"] == 0
    assert [*done.summary["totals"]] == ["net"]
    whole = pd.read_csv(tmp_path / "frames.csv")
    assert set(whole["variant"]) == {"net"}


def test_six_labels_that_must_train_are_refused_with_what_would_do(places, tmp_path):
    with pytest.raises(RoadevalError) as caught:
        replay(places, tmp_path, "6")
    said = str(caught.value)
    assert "all 6 labelled frames in the range are used for training, so none is left" in said
    assert all(each in said for each in ("`training.frames` to 3", "`training.model`", "`only`"))
    done = replay(places, tmp_path, "6", training={"frames": 3})
    assert (done.summary["frames"]["trained_on"], done.summary["frames"]["evaluated"]) == (3, 3)


def test_no_frames_for_training_are_enough_for_what_learns_nothing(places, tmp_path):
    done = replay(places, tmp_path, "6", ("net",), training={"frames": 0})
    assert done.summary["frames"]["evaluated"] == 6
    with pytest.raises(RoadevalError, match="because filtered and unfiltered must learn") as caught:
        replay(places, tmp_path, "6", training={"frames": 0})
    assert caught.value.setting == "training.frames"


@pytest.mark.parametrize(("truth", "only"), [("6", ("net",)), ("21", ())])
def test_labelled_frames_alone_give_the_tables_of_the_whole(places, tmp_path, truth, only):
    whole = replay(places, tmp_path / "whole", truth, only)
    part = replay(places, tmp_path / "part", truth, only, frames={"labelled": True})
    assert part.summary["frames"]["read"] == int(truth) < whole.summary["frames"]["read"] == FRAMES
    assert tables(tmp_path / "part") == tables(tmp_path / "whole")
    assert part.summary["totals"] == whole.summary["totals"]
    assert any(each.startswith("only frames with truth were read") for each in part.warnings)


def test_a_stride_that_misses_every_label_says_so(places, tmp_path):
    done = replay(places, tmp_path, "6", ("net",), frames={"every": 2})
    (said,) = [each for each in done.warnings if "none of the frames that were read" in each]
    assert "`frames.every` 2 leaves out all frames that have it" in said
    assert "`frames.labelled` reads only frames that have it" in said
    every = replay(places, tmp_path, "6", ("net",), frames={"every": 2, "labelled": True})
    assert every.summary["frames"]["evaluated"] == 3


def test_the_summary_says_where_truth_lies(places, tmp_path):
    def stated(folder, name):
        return replay(folder, tmp_path / name, "6", ("net",)).summary["masks"]["truth"]

    found = stated(places, "a")
    assert found["path"] == str(places / "6")
    assert found["pairing"] == "6 labels, paired by number"
    assert found["meaning"].startswith("a mask of 0 255: road is 255")
    assert found["frames"] == 6
    other = shutil.copytree(places, tmp_path / "other")
    assert stated(other, "b")["digest"] == found["digest"]
    cv2.imwrite(str(other / "6" / "5.png"), np.full((24, 32), 255, np.uint8))
    assert stated(other, "c")["digest"] != found["digest"]


@pytest.fixture
def fleet(places, tmp_path):
    """Two drives with the same frames, and labels of each below ``labels``."""
    for name in ("one", "two"):
        shutil.copy(places / "drive.mcap", tmp_path / f"{name}.mcap")
        shutil.copytree(places / "6", tmp_path / "labels" / name)

    def run(**tables: Any):
        executor = Here()
        given = tables.pop("drives", [tmp_path / "one.mcap", tmp_path / "two.mcap"])
        masks = {"net": {"path": str(places / "net")}}
        config = roadeval.configure({"masks": masks, "only": ["net"], **tables})
        done = roadeval.replay_fleet(given, tmp_path / "fleet", config, executor=executor)
        return done, [Path(task.entry.source).stem for task in executor.tasks]

    return run


def test_a_label_that_has_changed_replays_its_drive_of_a_fleet(fleet, tmp_path):
    truth = {"path": str(tmp_path / "labels" / "{drive}"), "first": 0}
    assert fleet(truth=truth)[0].counts == {"scored": 2}
    assert fleet(truth=truth)[1] == []
    label = tmp_path / "labels" / "two" / "5.png"
    before = label.stat()
    cv2.imwrite(str(label), np.full((24, 32), 255, np.uint8))
    os.utime(label, ns=(before.st_atime_ns, before.st_mtime_ns))
    done, submitted = fleet(truth=truth)
    assert (done.replayed, submitted) == (1, ["two"])
    (tmp_path / "labels" / "one" / "2.png").write_bytes(label.read_bytes())
    done, submitted = fleet(truth=truth)
    assert (done.replayed, submitted) == (1, ["one"])


def test_a_manifest_says_where_the_truth_of_a_drive_lies(fleet, tmp_path, monkeypatch):
    (tmp_path / "labels" / "two").rename(tmp_path / "labels" / "2024")
    monkeypatch.chdir(tmp_path / "labels")
    manifest = tmp_path / "fleet.toml"
    entries = [
        f'[[drives]]\npath = "{name}.mcap"\ntruth = {{ path = "{own}", first = 0 }}\n'
        for name, own in (("one", "one"), ("two", "2024"))
    ]
    manifest.write_text("\n".join(entries))
    assert fleet(drives=[manifest])[0].counts == {"scored": 2}


def test_train_and_info_take_truth_beside_the_log(places, tmp_path):
    drive, truth = places / "drive.mcap", ("--truth", places / "21")
    model = tmp_path / "a.model"
    run = here("train", drive, *truth, "-o", model)
    assert run.returncode == 0, run.stderr
    assert "by the truth" in run.stdout
    run = here("info", drive, *truth, "--json")
    assert run.returncode == 0, run.stderr
    picks = json.loads(run.stdout)["picks"]
    assert f"truth: {places / '21'} (21 labels, paired by number; " in picks[1]
    assert "no truth" not in " ".join(picks)


def test_frames_without_truth_and_without_doubt_are_not_ranked(tmp_path):
    """One method alone differs from no other, and one frame from none before."""
    write_log(tmp_path / "drive.mcap", truth=False, numbers=range(6))
    config = roadeval.configure({"only": ["unfiltered"], "training": {"frames": 5}})
    roadeval.replay(tmp_path / "drive.mcap", config, reports=tmp_path / "out")
    run = here("inspect", tmp_path / "out", "--list")
    assert run.returncode == 1
    assert "nothing was scored, so no frame is the worst" in run.stderr


def test_a_drive_gives_frames_to_pick_by_its_length_whatever_was_scored(tmp_path):
    for name, only in (("one", ["unfiltered"]), ("two", [])):
        write_log(tmp_path / f"{name}.mcap", truth=False, numbers=range(12))
        config = roadeval.configure({"only": only, "training": {"frames": 2}})
        roadeval.replay(tmp_path / f"{name}.mcap", config, save=tmp_path / f"{name}.rrd")
    recordings = [tmp_path / "one.rrd", tmp_path / "two.rrd"]
    assert [each.new for each in roadeval.pick(recordings, 6, tmp_path / "picks")] == [3, 3]


@pytest.mark.parametrize("job", [roadeval.compare, lambda none: roadeval.pick(none, 1, "picks")])
def test_a_job_that_is_given_nothing_says_so(job):
    with pytest.raises(RoadevalError, match="nothing to "):
        job([])
