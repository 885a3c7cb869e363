"""Labels that look wrong are written for correction, and read back in place of the drive's own."""

from __future__ import annotations

import html
import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

import roadeval
from roadeval import RoadevalError, RunConfig
from roadeval.jobs.results import audit as label_audit
from tests.e2e.commands import here
from tests.evaluation.test_fit import LABELS as FRAMES
from tests.evaluation.test_fit import image_at, method_at, wrong_labels
from tests.evaluation.test_fit import road_ahead as road_at
from tests.fixtures.logged import coco_of, write_drive
from tests.jobs.making import settings, write_log
from tests.report.making import text

NS = 100_000_000
IGNORED = slice(0, 10)
"""The rows that nobody labelled."""
CODES = {"labels": {"road": [3], "ignore": [11]}}


def stamp_of(frame: int) -> int:
    return (frame + 1) * NS


def label_of(frame: int, *, is_wrong: bool = False) -> np.ndarray:
    """The class ids of a frame's label: 3 is road, and 11 ignored."""
    road = wrong_labels()[frame][1] if is_wrong and frame in wrong_labels() else road_at(frame)
    label = np.where(road == 1, 3, 5).astype(np.uint8)
    label[IGNORED] = 11
    return label


def with_masks(base: Path, *names: str) -> RunConfig:
    """Settings of a run with masks from folders alone, which is quick."""
    masks = {name: {"path": str(base / name)} for name in names}
    return settings(record="masks").override({"masks": masks, "only": [*names]})


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive with five wrong labels, another person's labels, and the recording."""
    base = tmp_path_factory.mktemp("audit")
    for name in ("mine", "b"):
        (base / name).mkdir()
    for frame in range(FRAMES):
        second = road_at(frame)
        second[70:, :40] = 0
        for name, mask in (("mine", method_at(frame)), ("b", second)):
            cv2.imwrite(str(base / name / f"{stamp_of(frame):019d}.png"), mask * 255)
    labels = {frame: label_of(frame, is_wrong=True) for frame in range(FRAMES)}
    images = {frame: image_at(frame)[..., ::-1] for frame in labels}
    write_drive(
        base / "drive.mcap",
        ((stamp_of(f), {"/camera": images[f], "/truth/road": labels[f]}) for f in labels),
    )
    config = with_masks(base, "mine", "b").override(CODES)
    save, reports = base / "drive.rrd", base / "reports"
    roadeval.replay(base / "drive.mcap", config, save=save, reports=reports)
    return base


@pytest.fixture(scope="module", params=["png", "coco"])
def audited(request: pytest.FixtureRequest, place: Path):
    folder = place / request.param
    found = roadeval.audit(
        place / "drive.rrd", folder=folder, labels=request.param, annotators=["b"]
    )
    return found, folder


def truths(place: Path, folder: Path, tmp_path: Path) -> dict[int, np.ndarray]:
    """The truth of each frame in a replay with the corrected labels."""
    config = with_masks(place, "mine").override({"truth": {"path": str(folder)}})
    done = roadeval.replay(
        place / "drive.mcap", config, save=tmp_path / "o.rrd", reports=tmp_path / "r"
    )
    said = [text for text in done.warnings if "the labels of" in text]
    assert len(said) == 1
    assert said[0].endswith("all others are those of /truth/road")
    recording = roadeval.Recording(tmp_path / "o.rrd")
    return {frame: recording.truth(frame) for frame in range(FRAMES)}


def correct(folder: Path, frames: list[int]) -> None:
    """Export labels as a tool does: right ones of some frames, all others as proposed."""
    if not (coco := folder / "proposals" / "instances.json").exists():
        for proposal in (folder / "proposals").iterdir():
            shutil.copy(proposal, folder / "labels")
        for frame in frames:
            levels = np.select([label_of(frame) == 3, label_of(frame) == 11], [255, 128])
            cv2.imwrite(str(folder / "labels" / f"{stamp_of(frame):019d}.png"), levels)
        return
    areas = {f: {"road": label_of(f) == 3, "ignore": label_of(f) == 11} for f in frames}
    right = coco_of({f"{stamp_of(f):019d}.png": classes for f, classes in areas.items()})
    merged, other = json.loads(right), json.loads(coco.read_text())
    for entry in other["annotations"]:
        entry["category_id"] -= 1  # its classes begin at 1
    names = {image["file_name"] for image in merged["images"]}
    rest = {i["id"]: i for i in other["images"] if i["file_name"] not in names}
    for kind, kept in (
        ("images", [*rest.values()]),
        ("annotations", [a for a in other["annotations"] if a["image_id"] in rest]),
    ):
        for entry in kept:
            keys = {"id", "image_id"} & entry.keys()
            merged[kind].append({**entry, **{key: entry[key] + 1000 for key in keys}})
    (folder / "labels" / "instances.json").write_text(json.dumps(merged))


def test_the_wrong_labels_are_written_with_pictures_and_the_line_to_tell(audited) -> None:
    found, folder = audited
    clear = found.suspects.query("clear").frame.tolist()
    assert sorted(clear) == [*wrong_labels()]
    assert found.sentences[0] == "The labels of 5 frames look wrong: 3, 7, 12, 17, 21."
    table = json.loads((folder / "audit.json").read_text())["suspects"]
    pictures = sorted(picture.name for picture in (folder / "suspects").iterdir())
    assert pictures == [
        f"{row['rank']:02d}_frame_{row['frame']:04d}_{row['stamp_ns']:019d}.png" for row in table
    ]
    images = {image.name for image in (folder / "images").iterdir()}
    assert images == {f"{row['stamp_ns']:019d}.png" for row in table}


def test_how_far_two_people_differ_is_told(audited) -> None:
    said = audited[0].sentences[-1]
    assert said.startswith("b and the truth differ on ")
    assert said.endswith("differences of ERR below that mean nothing.")


@pytest.mark.parametrize("form", ["html", "pdf"])
def test_a_report_begins_its_reasons_with_what_an_audit_says(audited, place, tmp_path, form):
    found, folder = audited
    report = roadeval.write_report(
        place / "drive.rrd", tmp_path / f"report.{form}", audit=folder, focus="mine"
    )
    told = text(report.read_bytes()) if form == "pdf" else html.unescape(report.read_text())
    told = told.replace("\N{NO-BREAK SPACE}", " ")
    places = [told.index(words) for words in ("Why mine errs", *found.doubts)]
    assert len(places) == 3
    assert places == sorted(places)


def test_without_a_clearly_wrong_label_a_report_has_no_doubt_about_labels(place, monkeypatch):
    rank = label_audit.rank_suspects
    monkeypatch.setattr(
        label_audit, "rank_suspects", lambda *about: rank(*about).assign(clear=False)
    )
    found = roadeval.audit(place / "drive.rrd", annotators=["b"])
    assert found.sentences[0] == "No label is clearly wrong."
    assert found.doubts == found.sentences[1:]
    assert len(found.doubts) == 1


def test_a_report_takes_no_audit_of_another_drive(audited, place, tmp_path) -> None:
    other = Path(shutil.copytree(audited[1], tmp_path / "other"), "audit.json")
    about = json.loads(other.read_text())
    for wrong, problem in (
        (about | {"drive": "x"}, r"audit\.json: is of x /camera, not of drive"),
        (about | {"sentences": "x"}, r"audit\.json: damaged"),
        ({}, r"audit\.json: damaged"),
    ):
        other.write_text(json.dumps(wrong))
        with pytest.raises(RoadevalError, match=problem):
            roadeval.write_report(place / "drive.rrd", tmp_path / "r.pdf", audit=other.parent)
    with pytest.raises(RoadevalError, match=r"is not a folder of roadeval audit"):
        roadeval.write_report(place / "drive.rrd", tmp_path / "r.pdf", audit=tmp_path)
    assert not (tmp_path / "r.pdf").exists()


def test_corrected_labels_change_these_frames_and_no_others(
    audited, place: Path, tmp_path: Path
) -> None:
    _, folder = audited
    correct(folder, [3, 7])
    truth = truths(place, folder, tmp_path)
    codes = {3: 1, 11: 255}
    for frame in range(FRAMES):
        label = label_of(frame, is_wrong=frame not in (3, 7))
        expected = np.vectorize(lambda value: codes.get(value, 0))(label)
        assert np.array_equal(truth[frame], expected), frame


def test_an_audit_without_a_corrected_label_is_no_truth(place: Path, tmp_path: Path) -> None:
    roadeval.audit(place / "drive.rrd", folder=tmp_path / "new")
    config = settings().override({"truth": {"path": str(tmp_path / "new")}})
    assert "no label in it yet" in roadeval.info(place / "drive.mcap", config).problem


def test_audits_that_correct_each_other_are_damaged(place: Path, tmp_path: Path) -> None:
    for folder, corrected in (("a", "b"), ("b", "a")):
        roadeval.audit(place / "drive.rrd", 1, tmp_path / folder)
        about = json.loads((tmp_path / folder / "audit.json").read_text())
        about["run"]["truth"]["path"] = str(tmp_path / corrected)
        about["run"]["topics"]["truth"] = None
        (tmp_path / folder / "audit.json").write_text(json.dumps(about))
    config = settings().override({"truth": {"path": str(tmp_path / "a")}})
    assert "not as roadeval audit writes it" in roadeval.info(place / "drive.mcap", config).problem


def test_labels_to_correct_of_reduced_frames_are_refused_before_the_replay(
    place: Path, tmp_path: Path
) -> None:
    config = settings().override({"frames": {"scale": 0.5}})
    with pytest.raises(RoadevalError, match="does not go with labels to correct"):
        roadeval.audit(place / "no_log.mcap", folder=tmp_path / "x", config=config)
    assert not (tmp_path / "x").exists()


def test_a_fleet_an_annotator_without_masks_and_a_folder_with_something_else_are_refused(
    place: Path, tmp_path: Path
) -> None:
    (tmp_path / "fleet.json").write_text("{}")
    with pytest.raises(RoadevalError, match="a fleet: audit its drives one by one"):
        roadeval.audit(tmp_path)
    with pytest.raises(RoadevalError, match="no masks of c"):
        roadeval.audit(place / "drive.rrd", annotators=["c"])
    with pytest.raises(RoadevalError, match="is not empty"):
        roadeval.audit(place / "drive.rrd", folder=tmp_path)


@pytest.mark.parametrize("words", [[], ["--preset", "gated"]])
def test_a_log_is_audited_with_the_preset_that_errs_least_or_the_chosen_one(
    place: Path, tmp_path: Path, words: list[str]
) -> None:
    truth = ["--road-label", "3", "--ignore-label", "11"]
    run = here("audit", place / "drive.mcap", *truth, *words, "-o", tmp_path / "x", "--quiet")
    assert run.returncode == 0
    assert roadeval.load_config(tmp_path / "x" / "run.toml").preset == (words or ["robust"])[-1]


def test_from_python_it_is_the_same_preset(tmp_path: Path) -> None:
    roadeval.audit(write_log(tmp_path / "small.mcap"), folder=tmp_path / "x")
    assert roadeval.load_config(tmp_path / "x" / "run.toml").preset == "robust"


def test_the_command_shows_what_is_wrong_and_what_to_type_next(place: Path, tmp_path: Path) -> None:
    result = place / "drive.rrd"
    run = here("audit", result, "-n", 3, "-o", tmp_path / "x")
    assert run.returncode == 0
    assert run.stdout.startswith("The labels of 3 frames look wrong: ")
    assert "left and right are exchanged" in run.stdout
    assert f"--config {result} --truth {tmp_path / 'x'}" in run.stdout
    run = here("audit", result, "--json")
    assert (run.returncode, json.loads(run.stdout)["suspects"][0]["clear"]) == (0, True)
    run = here("audit", result, "--truth", place / "mine")
    assert run.returncode == 2
    assert "a result has its truth and masks; give the log" in run.stderr
