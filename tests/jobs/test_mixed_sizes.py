"""Frames of several sizes in one topic: each label is its own image's."""

from pathlib import Path

import cv2
import numpy as np
import pytest

import roadeval
from roadeval.logs.log import describe
from roadeval.logs.writing.writer import LogWriter
from tests.jobs.making import NS, settings

SIZES = ((64, 48), (80, 40), (40, 60))
FRAMES = 12


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with labels and masks of each frame's own size; a fifth of the road is missed."""
    base = tmp_path_factory.mktemp("mixed")
    (base / "lab").mkdir()
    (base / "masks").mkdir()
    with LogWriter(base / "drive.mcap") as log:
        for number in range(FRAMES):
            width, height = SIZES[number % len(SIZES)]
            image = np.full((height, width, 3), 160, np.uint8)
            truth = np.zeros((height, width), np.uint8)
            truth[:, width // 2 :] = 255
            image[truth > 0] = 80
            mask = truth.copy()
            mask[: height // 5] = 0
            log.image("/camera", number * NS, cv2.imencode(".jpg", image)[1].tobytes(), "jpeg")
            log.mask("/truth/road", number * NS, truth)
            cv2.imwrite(str(base / "lab" / f"{number:04d}.png"), truth)
            cv2.imwrite(str(base / "masks" / f"{number:04d}.png"), mask)
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
    assert done.summary["verdict"].endswith("The images' sizes vary.")
    assert any("8 of the 12 are not of the first one's size" in each for each in done.warnings)
    assert any("the images' sizes vary" in each for each in describe(drive / "drive.mcap").picks)


def test_a_recording_shows_all_images_in_one_size(drive: Path, tmp_path: Path) -> None:
    """Rerun's viewer takes encoded images for a video, and covers one whose size changes."""
    config = settings(train_frames=4)
    roadeval.replay(drive / "drive.mcap", config, save=tmp_path / "o.rrd", reports=tmp_path / "r")
    recording = roadeval.Recording(tmp_path / "o.rrd")
    sizes = {recording.image(number).shape for number in range(FRAMES)}
    sizes |= {recording.layer("filtered", "post", number).shape for number in range(FRAMES)}
    assert sizes == {(48, 64, 3), (48, 64)}
