"""What does not fit the images: told first, with what mends it; frames of several sizes."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

import roadeval
from roadeval import RoadevalError
from tests.evaluation.test_fit import IMAGES, ROADS
from tests.fixtures.logged import jpeg, write_drive
from tests.jobs.making import settings

NS = 100_000_000
TRUTH = "The truth is 3 frames (300 ms) late: it fits earlier images better. "


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with late truth, one without, and folders with late, early and mirrored masks."""
    base = tmp_path_factory.mktemp("misfits")
    for name in ("late", "early", "mirrored"):
        (base / name).mkdir()
    images = [((n + 1) * NS, {"/camera": image[..., ::-1]}) for n, image in enumerate(IMAGES)]
    truth = [((n + 4) * NS, {"/truth/road": ROADS[n] * 255}) for n in range(len(IMAGES))]
    write_drive(base / "bare.mcap", images)
    write_drive(base / "late.mcap", sorted(images + truth, key=lambda message: message[0]))
    for number in range(len(IMAGES)):
        for name, mask in (("late", ROADS[number]), ("mirrored", ROADS[number][:, ::-1])):
            place = number + 3 if name == "late" else number
            cv2.imwrite(str(base / name / f"{place:04d}.png"), mask * np.uint8(255))
        if number >= 3:
            cv2.imwrite(str(base / "early" / f"{number - 3:04d}.png"), ROADS[number] * 255)
    return base


def verdict(drive: Path, tmp_path: Path, **tables: object) -> str:
    config = settings(train_frames=4, only=["unfiltered"]).override(tables)
    done = roadeval.replay(drive, config, reports=tmp_path / "reports")
    misfits = done.summary.get("misfits", [])
    assert done.summary["verdict"].startswith(" ".join(misfits))
    return " ".join(misfits)


def test_truth_of_the_log_that_is_late_is_told_and_the_offset_mends_it(
    places: Path, tmp_path: Path
) -> None:
    said = verdict(places / "late.mcap", tmp_path)
    assert said.startswith(TRUTH)
    (offset,) = re.findall(r"Set `topics.sync_offset_ms` to (-?\d+)\.", said)
    assert offset == "-300"
    assert verdict(places / "late.mcap", tmp_path, topics={"sync_offset_ms": -300}) == ""


def test_truth_beside_the_log_that_is_late_is_told_by_info_too_and_its_number_mends_it(
    places: Path, tmp_path: Path
) -> None:
    late = {"path": str(places / "late"), "first": 0}
    config = settings().override({"truth": late})
    said = verdict(places / "bare.mcap", tmp_path, truth=late)
    assert said == f"{TRUTH}Set `truth.first` to 3."
    assert roadeval.info(places / "bare.mcap", config).misfits == (said,)
    assert verdict(places / "bare.mcap", tmp_path, truth={**late, "first": 3}) == ""
    with pytest.raises(RoadevalError, match="only stamps can be moved") as refused:
        verdict(places / "bare.mcap", tmp_path, truth=late, topics={"sync_offset_ms": 100})
    assert refused.value.setting == "topics.sync_offset_ms"


def test_masks_are_told_with_what_can_be_set_and_no_number_changes(
    places: Path, tmp_path: Path
) -> None:
    names = ("early", "mirrored")
    masks = {name: {"path": str(places / name), "first": 0} for name in names}
    truth = {"path": str(places / "late"), "first": 3}
    said = verdict(places / "bare.mcap", tmp_path, masks=masks, truth=truth, only=names)
    assert "The masks of early are 3 frames (300 ms) early: they fit later images better." in said
    assert "The masks of mirrored are mirrored" in said
    assert "first` to -3" not in said
    assert said.count("No number is corrected for it: mend the masks where they are made.") == 2


SIZES = ((64, 48), (80, 40), (40, 60))
FRAMES = 12


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with labels and masks of each frame's own size; a fifth of the road is missed."""
    base = tmp_path_factory.mktemp("mixed")
    (base / "lab").mkdir()
    (base / "masks").mkdir()

    def messages(number):
        width, height = SIZES[number % len(SIZES)]
        image = np.full((height, width, 3), 160, np.uint8)
        truth = np.zeros((height, width), np.uint8)
        truth[:, width // 2 :] = 255
        image[truth > 0] = 80
        mask = truth.copy()
        mask[: height // 5] = 0
        cv2.imwrite(str(base / "lab" / f"{number:04d}.png"), truth)
        cv2.imwrite(str(base / "masks" / f"{number:04d}.png"), mask)
        return {"/camera": jpeg(image), "/truth/road": truth}

    write_drive(base / "drive.mcap", ((n * NS, messages(n)) for n in range(FRAMES)))
    return base


@pytest.mark.parametrize("beside", [True, False])
def test_labels_are_held_against_their_own_images_and_that_sizes_vary_is_said(
    drive: Path, tmp_path: Path, beside: bool
) -> None:
    truth = {"truth": {"path": str(drive / "lab")}} if beside else {}
    masks = {"mine": {"path": str(drive / "masks")}}
    config = settings().override({**truth, "masks": masks, "only": ["mine"]})
    done = roadeval.replay(drive / "drive.mcap", config, reports=tmp_path / "reports")
    assert done.summary["totals"]["mine"]["post"]["frames"] == FRAMES
    assert done.summary["totals"]["mine"]["post"]["ERR"] == pytest.approx(0.1, abs=0.005)
    assert any("8 of the 12 are not of the first one's size" in each for each in done.warnings)
    assert any(
        "the images' sizes vary" in each for each in roadeval.info(drive / "drive.mcap").picks
    )


def test_a_recording_shows_all_images_in_one_size(drive: Path, tmp_path: Path) -> None:
    """Rerun's viewer takes encoded images for a video, and covers one whose size changes."""
    config = settings(train_frames=4)
    roadeval.replay(drive / "drive.mcap", config, save=tmp_path / "o.rrd", reports=tmp_path / "r")
    recording = roadeval.Recording(tmp_path / "o.rrd")
    sizes = {recording.image(number).shape for number in range(FRAMES)}
    sizes |= {recording.layer("filtered", "post", number).shape for number in range(FRAMES)}
    assert sizes == {(48, 64, 3), (48, 64)}
