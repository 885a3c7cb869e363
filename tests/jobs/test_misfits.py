"""What does not fit the images is the verdict's first sentence, and its remedy mends it."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

import roadeval
from roadeval import RoadevalError
from roadeval.logs.writing.writer import LogWriter
from tests.evaluation.test_fit import IMAGES, ROADS
from tests.jobs.making import settings

NS = 100_000_000
TRUTH = "The truth is 3 frames (300 ms) late: it fits earlier images better. "


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with late truth, one without, and folders with late, early and mirrored masks."""
    base = tmp_path_factory.mktemp("misfits")
    for name in ("late", "early", "mirrored"):
        (base / name).mkdir()
    with LogWriter(base / "late.mcap") as late, LogWriter(base / "bare.mcap") as bare:
        for number, image in enumerate(IMAGES):
            stamp, (_, png) = (number + 1) * NS, cv2.imencode(".png", image)
            for log in (late, bare):
                log.image("/camera", stamp, png.tobytes(), "png")
            late.mask("/truth/road", stamp + 3 * NS, ROADS[number] * 255)
            for name, mask in (("late", ROADS[number]), ("mirrored", ROADS[number][:, ::-1])):
                place = number + 3 if name == "late" else number
                cv2.imwrite(str(base / name / f"{place:04d}.png"), mask * np.uint8(255))
            if number >= 3:
                cv2.imwrite(str(base / "early" / f"{number - 3:04d}.png"), ROADS[number] * 255)
    return base


def verdict(drive: Path, tmp_path: Path, **tables: object) -> str:
    config = settings(train_frames=4).override(tables)
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


def test_an_offset_of_stamps_is_refused_where_numbers_pair(places: Path, tmp_path: Path) -> None:
    late = {"path": str(places / "late"), "first": 0}
    with pytest.raises(RoadevalError, match="only stamps can be moved") as refused:
        verdict(places / "bare.mcap", tmp_path, truth=late, topics={"sync_offset_ms": 100})
    assert refused.value.setting == "topics.sync_offset_ms"
