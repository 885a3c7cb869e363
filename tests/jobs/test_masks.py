"""Masks that lie beside the log give the numbers of the same masks in it."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from sklearn.metrics import average_precision_score

import roadeval
from roadeval import RoadevalError
from roadeval.jobs.run.prepared import identity
from roadeval.logs.log import open_log
from tests.fixtures.logged import frames_in, write_drive
from tests.jobs.making import FRAMES, settings, write_log

IN_LOG = "/net/road_mask_prediction"
WITH_MASKS = {"topics": {"masks": {"net": IN_LOG}}}


@pytest.fixture(scope="module")
def places(tmp_path_factory) -> Path:
    """A log with masks in it, the same masks in folders of every kind, and in another log."""
    base = tmp_path_factory.mktemp("places")
    drive = write_log(base / "drive.mcap", net=True)
    kinds = ("number", "stamp", "npy", "classes", "confidence", "images", "named", "half")
    for kind in kinds:
        (base / kind).mkdir()
    frames = frames_in(drive, **WITH_MASKS)
    for frame in frames:
        _write(base, frame.number, frame.stamp_ns, rolled(frame))
    write_drive(base / "other.mcap", ((f.stamp_ns, {"/seg": rolled(f)}) for f in frames))
    return base


def rolled(frame):
    """A mask that is wrong somewhere, and elsewhere in each frame."""
    return np.roll(frame.external["net"], frame.number % 5 - 2, 0)


def _write(base, number, stamp, mask):
    cv2.imwrite(str(base / "number" / f"frame_{number:04d}.png"), mask * 255)
    cv2.imwrite(str(base / "stamp" / f"{stamp:019d}.png"), mask)
    np.save(base / "npy" / f"{number}.npy", mask.astype(bool))
    cv2.imwrite(str(base / "classes" / f"{number}.png"), 3 + 4 * mask)
    cv2.imwrite(str(base / "confidence" / f"{number}.png"), 100 + 55 * mask)
    name = f"{chr(ord('a') + number)}.png"
    (base / "images" / name).touch()
    cv2.imwrite(str(base / "named" / name), mask)
    if number % 2:
        cv2.imwrite(str(base / "half" / f"{number}.png"), mask * 255)


def masks(base, **tables):
    return {
        name: {
            key: str(base / value) if key in ("path", "images") else value
            for key, value in own.items()
        }
        for name, own in tables.items()
    }


@pytest.fixture(scope="module")
def outcome(places, tmp_path_factory):
    """A replay with the masks of all places side by side; with those in the log, rolled alike."""
    inside = tmp_path_factory.mktemp("inside")

    def messages(frame):
        truth = None if frame.truth is None else frame.truth * 255
        return {
            "/camera/image": bytes(frame.payload),
            "/truth/road": truth,
            IN_LOG: rolled(frame) * 255,
        }

    frames = frames_in(places / "drive.mcap", **WITH_MASKS)
    drive = write_drive(inside / "drive.mcap", ((f.stamp_ns, messages(f)) for f in frames))
    beside = masks(
        places,
        number={"path": "number"},
        stamp={"path": "stamp"},
        npy={"path": "npy"},
        classes={"path": "classes", "labels": {"road": [7]}},
        confidence={"path": "confidence", "threshold": 0.5},
        named={"path": "named", "images": "images"},
        other={"path": "other.mcap:/seg"},
        order={"path": "other.mcap:/seg", "pair": "number"},
        half={"path": "half", "first": 0},
    )
    config = settings(masks={"inside": IN_LOG}).override({"masks": beside})
    return roadeval.replay(drive, config, save=inside / "out.rrd", reports=inside / "reports")


WHOLE = ("number", "stamp", "npy", "classes", "confidence", "named", "other", "order")


@pytest.mark.parametrize("name", WHOLE)
def test_the_numbers_are_those_of_the_same_masks_in_the_log(outcome, name):
    frames = roadeval.Recording(outcome.recording).frames

    def of(variant):
        return frames[frames["variant"] == variant].drop(columns="variant").to_numpy().tolist()

    assert of(name) == of("inside")
    assert outcome.summary["totals"]["inside"]["post"]["FP"] > 0


def test_a_frame_without_a_mask_is_left_out_of_its_variant_and_told(outcome):
    assert outcome.summary["totals"]["half"]["post"]["frames"] == 8
    assert outcome.summary["totals"]["number"]["post"]["frames"] == 15
    assert outcome.summary["masks"]["half"]["frames"] == FRAMES // 2
    (told,) = [each for each in outcome.warnings if each.startswith("half: ")]
    assert "13 of the 26 frames read have no mask" in told


def test_curves_are_counted_on_the_evaluated_frames(outcome, places):
    recording = roadeval.Recording(outcome.recording)
    truths, levels = [], []
    for number in sorted(set(recording.frames["frame"])):
        truth = recording.truth(number)
        level = cv2.imread(str(places / "confidence" / f"{number}.png"), 0)
        truths.append(truth[truth != 255])
        levels.append(level[truth != 255] / 255)
    (own,) = outcome.summary["curves"].values()
    y, p = np.concatenate(truths), np.concatenate(levels)
    assert own["post"]["AP"] == pytest.approx(average_precision_score(y, p), abs=1e-12)
    assert own["post"]["frames"] == 15
    assert own["post"]["threshold"] == pytest.approx(155 / 255)


def test_a_variant_of_one_result_is_held_against_another_of_another(outcome, places, tmp_path):
    roadeval.replay(places / "drive.mcap", settings(record="none"), reports=tmp_path / "reports")
    with pytest.raises(RoadevalError, match="no variant inside"):
        roadeval.compare([tmp_path / "reports", outcome.reports], variants=["inside"])
    found = roadeval.compare([outcome.reports, outcome.reports], variants=["inside=unfiltered"])
    alone = roadeval.compare([outcome.reports], variants=["inside", "unfiltered"])
    (change,), (same,) = found.comparison.changes, alone.comparison.changes
    assert (change.variant, change.difference) == ("unfiltered", same.difference)
    assert [r.difference.mean for r in found.comparison.regions] == [
        r.difference.mean for r in alone.comparison.regions
    ]
    assert "(inside)" in found.comparison.results[0].label


def refused(places, **table) -> str:
    config = settings().override({"masks": {"net": table}})
    with pytest.raises(RoadevalError) as caught:
        roadeval.replay(places / "drive.mcap", config, reports=places / "refused")
    assert not (places / "refused").exists()
    return str(caught.value)


def test_masks_of_another_time_or_size_are_refused_unless_they_are_to_be_scaled(places, tmp_path):
    write_drive(tmp_path / "other.mcap", [(10**18, {"/seg": np.eye(4, dtype=np.uint8)})])
    assert "none of them belongs to a frame" in refused(places, path=f"{tmp_path}/other.mcap:/seg")
    (tmp_path / "other.mcap").unlink()
    for number in range(FRAMES):
        mask = cv2.imread(str(places / "number" / f"frame_{number:04d}.png"), 0)
        cv2.imwrite(str(tmp_path / f"{number}.png"), cv2.resize(mask, (30, 20)) // 128 * 255)
    message = refused(places, path=str(tmp_path))
    assert "is 30x20, but /camera/image is" in message
    assert "`topics.resize_truth`" in message
    config = settings(resize_truth=True).override({"masks": {"net": {"path": str(tmp_path)}}})
    done = roadeval.replay(places / "drive.mcap", config, reports=tmp_path / "reports")
    assert done.summary["totals"]["net"]["post"]["frames"] == 15


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            {"path": "classes"},
            "`masks.net.labels.road`, and those to leave out with `masks.net.labels.ignore`; or, "
            "for confidences, their threshold",
        ),
        ({"path": "npy", "threshold": 0.5}, "is 1: these are masks, and no confidences; leave"),
        ({"path": "other.mcap"}, "name a topic of it, as"),
        (
            {"path": "other.mcap:/no"},
            "/no is not in the log; its label topics are: /seg",
        ),
        (
            {"path": "other.mcap:/seg", "images": "images"},
            "`masks.net.images`: only labels in files can be paired by name",
        ),
    ],
)
def test_masks_that_cannot_be_used_are_one_line(places, table, message):
    (own,) = masks(places, net=table).values()
    found = refused(places, **own)
    assert message in found
    assert "`masks` net: " in found
    assert "\n" not in found


def test_a_broken_mask_costs_its_frame_and_is_named(places, tmp_path):
    for file in (places / "number").iterdir():
        content = b"no image" if file.name == "frame_0015.png" else file.read_bytes()
        (tmp_path / file.name).write_bytes(content)
    config = settings().override({"masks": {"net": {"path": str(tmp_path)}}})
    done = roadeval.replay(places / "drive.mcap", config, reports=tmp_path / "reports")
    (loss,) = done.losses
    assert loss.startswith(f"frame 15: {tmp_path}/frame_0015.png: ")


def test_masks_of_other_content_make_another_recording_wherever_they_lie(places):
    def of(digest, path):
        config = settings().override({"masks": {"net": {"path": path}}})
        with open_log(places / "drive.mcap") as log:
            return identity(log, config, {"net": digest})

    assert of("1", "here") == of("1", "there") != of("2", "here")


@pytest.mark.parametrize(("level", "where"), [(128, "nowhere"), (255, "everywhere")])
def test_truth_of_one_kind_alone_is_told_of(places, level, where, tmp_path):
    """If nothing is trained, nothing else would notice that labels are read wrongly."""
    (tmp_path / "truth").mkdir()
    for frame in frames_in(places / "drive.mcap", **WITH_MASKS):
        label = np.full(frame.external["net"].shape, level, np.uint8)
        label[:4] = 255 * (level == 255)
        cv2.imwrite(str(tmp_path / "truth" / f"{frame.number}.png"), label)
    beside = masks(places, npy={"path": "npy"})
    labels = {"path": str(tmp_path / "truth")}
    config = roadeval.configure({"truth": labels, "masks": beside, "only": ["npy"]})
    outcome = roadeval.replay(places / "drive.mcap", config, reports=tmp_path / "out")
    assert any(f"the truth is road {where}" in warning for warning in outcome.warnings)
