"""From no truth to a number: pick frames, label them, replay with them, pick on."""

import json
import re
import shlex
import shutil

import numpy as np
import pandas as pd
import pytest
from PIL import Image

import roadeval
from tests.e2e.commands import here
from tests.e2e.test_rig import a_rig
from tests.fixtures.logged import coco_of, frames_in

HIDDEN = ("--truth-topic", "", "--config", "quick.toml")
QUICK = """
preset = "robust"
trees.trees = 15
training.pixels_per_class = 50
"""
"""Some trees are enough: what is picked and counted is tested here, not how good it is."""


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """A folder with a drive whose truth is hidden, its recording, and picked frames."""
    folder = tmp_path_factory.mktemp("pick")
    a_rig(folder / "street.mcap", {"front": (0, 40)})
    (folder / "quick.toml").write_text(QUICK)
    words = ("--save", "out.rrd", "--reports", "reports", *HIDDEN)
    assert here("replay", "street.mcap", *words, cwd=folder).returncode == 0
    done = here("pick", "out.rrd", "-n", 10, "-o", "to_label", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "10 frames to label: 5 drawn at random of" in done.stdout
    assert "5 most in doubt (by entropy)" in done.stdout
    assert "roadeval replay street.mcap --config out.rrd --truth to_label" in done.stdout
    return folder


@pytest.fixture
def work(begun, tmp_path):
    """A copy of that folder."""
    return shutil.copytree(begun, tmp_path / "work")


@pytest.fixture(scope="module")
def truths(begun):
    """The truth of each frame by its stamp."""
    return {frame.stamp_ns: frame.truth for frame in frames_in(begun / "street.mcap")}


def picks_in(folder):
    """Read the picks of a folder as another program would read them."""
    return json.loads((folder / "pick.json").read_text())


def label(folder, truths, only=None, form="png"):
    """Put true labels of picked frames where an annotator would put them."""
    stamps = stamps_of(picks_in(folder), only)
    values = np.array([0, 255], np.uint8)
    roads = {f"{stamp:019d}.png": truths[stamp] == 1 for stamp in sorted(stamps)}
    for name, road in roads.items() if form == "png" else ():
        Image.fromarray(values[road.astype(int)]).save(folder / "labels" / name)
    if form != "png":
        areas = {name: {"road": road} for name, road in roads.items()}
        (folder / "labels" / "instances.json").write_text(coco_of(areas))


def stamps_of(picks, why=None):
    """Return the stamps of the frames that were picked, for one reason or for any."""
    return {frame["stamp_ns"] for frame in picks["picked"] if why in (None, frame["why"])}


def scored(work, *words):
    """Replay with the picked labels; return the summary and what was said."""
    outputs = ("--save", "new.rrd", "--reports", "new")
    done = here("replay", "street.mcap", *outputs, *HIDDEN, "--truth", "to_label", *words, cwd=work)
    assert done.returncode == 0, done.stderr
    return json.loads((work / "new" / "summary.json").read_text()), done


@pytest.fixture(scope="module")
def labelled(begun, truths, tmp_path_factory):
    """A copy in which every picked frame is labelled by an image, and the log replayed with it."""
    work = shutil.copytree(begun, tmp_path_factory.mktemp("labelled") / "work")
    label(work / "to_label", truths)
    return work, *scored(work)


def test_the_folder_has_images_masks_to_correct_and_why_each(begun):
    folder = begun / "to_label"
    known = json.loads((folder / "pick.json").read_text())
    assert [e["why"] for e in known["picked"]].count("random") == 5
    assert {e["probability"] for e in known["picked"] if e["why"] == "random"} == {
        5 / len(known["stamps"])
    }
    assert known["method"]["ranked_by"] == "entropy"
    names = {f"{e['stamp_ns']:019d}.png" for e in known["picked"]}
    for part in ("images", "proposals"):
        assert {each.name for each in (folder / part).iterdir()} == names
    frames = pd.read_csv(begun / "reports" / "unlabelled.csv")
    assert known["stamps"] == frames.stamp_ns.tolist()
    assert known["scores"] == pytest.approx(frames.entropy.tolist())


def test_the_number_is_from_the_random_part_alone_and_the_ranked_part_trains(labelled):
    work, summary, done = labelled
    drawn = stamps_of(picks_in(work / "to_label"), "random")
    frames = pd.read_csv(work / "new" / "frames.csv").query("variant == 'robust'")
    assert {*frames.stamp_ns} == drawn
    assert summary["frames"]["trained_on"] == 5
    found = summary["estimate"]["rates"]["robust"]["ERR"]
    own = frames.query("stage == 'post'").ERR
    assert found["mean"] == pytest.approx(own.mean())
    assert found["low"] < found["mean"] < found["high"]
    assert f"from 5 labelled frames, drawn at random, of {found['frames']}" in " ".join(
        done.stdout.split()
    )


def test_what_the_ranked_part_shows_never_enters_the_number(work, truths):
    words = ("--config", "patch.toml", "--record", "none")
    (work / "patch.toml").write_text(f'{QUICK}training.source = "patch"\n')
    label(work / "to_label", truths)
    before, _ = scored(work, *words)
    label(work / "to_label", {stamp: 1 - (t == 1) for stamp, t in truths.items()}, "ranked")
    after, _ = scored(work, *words)
    assert before["estimate"]["rates"] == after["estimate"]["rates"]
    assert before["totals"] == after["totals"]
    assert before["estimate"]["apart"] != after["estimate"]["apart"]
    assert len(after["estimate"]["apart"]) == 5


@pytest.mark.sweep
def test_labels_in_coco_give_the_numbers_of_the_images(work, truths, labelled):
    _, images, _ = labelled
    label(work / "to_label", truths, form="coco")
    others, _ = scored(work, "--record", "none")
    assert others["estimate"] == images["estimate"]
    assert others["totals"] == images["totals"]


def test_the_folder_of_labels_alone_is_taken_for_the_picks_whose_labels_it_holds(labelled):
    work, summary, _ = labelled
    words = ("--truth", "to_label/labels", "--record", "none", *HIDDEN)
    done = here("replay", "street.mcap", "--reports", "alone", *words, cwd=work)
    assert done.returncode == 0, done.stderr
    found = json.loads((work / "alone" / "summary.json").read_text())
    assert found["estimate"] == summary["estimate"]


@pytest.mark.sweep
def test_stamps_that_a_program_has_rounded_are_found_nevertheless(work, truths, labelled):
    """JavaScript and jq 1.6 keep numbers as floats of 64 bits."""
    _, summary, _ = labelled
    label(work / "to_label", truths)
    path = work / "to_label" / "pick.json"
    rounded = re.sub(r"\d{19}", lambda digits: f"{float(digits[0]):.17g}", path.read_text())
    path.write_text(rounded)
    assert scored(work, "--record", "none")[0]["estimate"] == summary["estimate"]


def test_labels_that_were_renumbered_are_refused(work, truths):
    folder = work / "to_label"
    label(folder, truths)
    for number, file in enumerate(sorted((folder / "labels").iterdir())):
        file.rename(file.with_name(f"{number:04}.png"))
    done = here("replay", "street.mcap", *HIDDEN, "--truth", "to_label", cwd=work)
    assert done.returncode == 1
    assert "labels have numbers of frames that were not picked (0000.png" in done.stderr


def test_a_pick_that_was_killed_can_be_run_again(begun, work):
    folder = work / "to_label"
    (folder / "pick.json").unlink()
    words = ("pick", "out.rrd", "-n", 10, "-o", "to_label")
    assert here(*words, cwd=work).returncode == 0
    assert picks_in(folder) == picks_in(begun / "to_label")
    (folder / "pick.json").unlink()
    (folder / "labels" / "mine.png").touch()
    assert "holds something else" in here(*words, cwd=work).stderr


def test_proposals_as_they_are_count_as_no_labels(work, truths):
    folder = work / "to_label"
    label(folder, truths)
    drawn = sorted(stamps_of(picks_in(folder), "random"))
    for stamp in drawn[:2]:
        shutil.copy(folder / "proposals" / f"{stamp:019d}.png", folder / "labels")
    summary, done = scored(work, "--record", "none")
    assert summary["estimate"]["labels"] == summary["frames"]["evaluated"] == 3
    assert "2 of the 5 frames that were drawn at random have no label yet" in done.stderr
    assert "2 labels are as they were proposed" in done.stderr


def test_a_label_of_a_frame_that_was_not_picked_is_in_no_number(work, truths, labelled):
    folder = work / "to_label"
    label(folder, truths)
    _, alone, _ = labelled
    picks = picks_in(folder)
    other = next(stamp for stamp in picks["stamps"] if stamp not in stamps_of(picks))
    Image.fromarray((truths[other] == 1).astype(np.uint8) * 255).save(
        folder / "labels" / f"{other:019d}.png"
    )
    summary, done = scored(work, "--record", "none")
    assert summary["estimate"]["rates"] == alone["estimate"]["rates"]
    assert "1 labels are of frames that were not picked" in done.stderr


def test_a_log_that_changed_gives_no_number_for_the_whole_drive(work, truths):
    label(work / "to_label", truths)
    path = work / "to_label" / "pick.json"
    known = json.loads(path.read_text())
    path.write_text(json.dumps({**known, "log": "another"}))
    summary, done = scored(work, "--record", "none")
    assert summary["estimate"]["rates"] == {}
    assert summary["frames"]["evaluated"] == 5
    assert "no number for the whole drive: the log is not as it was" in done.stderr


def test_picking_on_repeats_no_frame_and_keeps_the_probabilities_right(labelled, tmp_path):
    work = shutil.copytree(labelled[0], tmp_path / "work")
    before = picks_in(work / "to_label")
    done = here("pick", "new.rrd", "-n", 8, "-o", "to_label", cwd=work)
    assert done.returncode == 0, done.stderr
    after = picks_in(work / "to_label")
    assert len(after["picked"]) == len(stamps_of(after)) == 18
    assert stamps_of(before) < stamps_of(after)
    assert after["drawn"] == 9
    random = [frame for frame in after["picked"] if frame["why"] == "random"]
    assert len(random) == 9
    assert {frame["probability"] for frame in random} == {9 / len(after["stamps"])}
    at_once = here("pick", "out.rrd", "-n", 18, "-o", "at_once", cwd=work)
    assert at_once.returncode == 0
    assert stamps_of(picks_in(work / "at_once"), "random") == stamps_of(after, "random")


def test_a_folder_that_has_all_frames_stays_as_it_is(begun, tmp_path):
    words = ("pick", "out.rrd", "-n", 1000, "--format", "coco", "-o", tmp_path / "all")
    assert here(*words, cwd=begun).returncode == 0
    proposals = (tmp_path / "all" / "proposals" / "instances.json").read_bytes()
    again = here(*words, cwd=begun)
    assert again.returncode == 0, again.stderr
    assert ": 0 frames to label" in again.stdout
    (file,) = (tmp_path / "all" / "proposals").iterdir()
    assert file.read_bytes() == proposals


@pytest.mark.sweep
def test_a_log_is_replayed_first_and_several_drives_have_a_folder_each(
    work, truths, without_workers
):
    shutil.copy(work / "street.mcap", work / "second.mcap")
    (work / "first.toml").write_text('topics.truth = ""\nframes.max_frames = 20\n' + QUICK)
    words = ("-n", 6, "-o", "both", "--config", "first.toml")
    done = here("pick", "street.mcap", "second.mcap", *words, cwd=work)
    assert done.returncode == 0, done.stderr
    assert {each.name for each in (work / "both").iterdir()} == {"street", "second"}
    assert len(picks_in(work / "both" / "second")["picked"]) == 3
    assert "results into both/{drive}/labels." in " ".join(done.stdout.split())
    for name in ("street", "second"):
        label(work / "both" / name, truths)
    command = shlex.split(done.stdout.rpartition("next")[2])
    assert here(*command[1:], cwd=work).returncode == 0
    scored = roadeval.Result(work / "labelled").frames
    picks = [picks_in(work / "both" / name) for name in ("street", "second")]
    assert {*scored.stamp_ns} == stamps_of(picks[0], "random") | stamps_of(picks[1], "random")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("out.rrd", "-n", 5, "-o", "reports"), "holds something else"),
        (("out.rrd", "-n", 5, "-o", "x", "--by", "nobody"), "no variant nobody; there are"),
        (("moved", "-n", 5, "-o", "x"), "moved: its recording is not at elsewhere.rrd; name"),
        (("unrecorded", "-n", 5, "-o", "x"), "unrecorded: its replay made no recording; replay"),
        (("whole.mcap", "-n", 5, "-o", "x"), "whole.mcap: every frame has truth"),
        (("nothing.rrd", "-n", 5, "-o", "x"), "nothing.rrd"),
    ],
)
def test_what_cannot_be_picked_is_one_line(work, words, said):
    shutil.copy(work / "street.mcap", work / "whole.mcap")
    facts = json.loads((work / "reports" / "summary.json").read_text())
    facts["run"]["output"]["save"] = "elsewhere.rrd"
    for name, record in (("moved", "all"), ("unrecorded", "none")):
        facts["run"]["output"]["record"] = record
        (work / name).mkdir()
        (work / name / "summary.json").write_text(json.dumps(facts))
    done = here("pick", *words, "--quiet", cwd=work)
    assert done.returncode == 1
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
