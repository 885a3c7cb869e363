"""Every kind of camera message, each in a small log, decodes to the frames it was made from."""

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.log import open_log
from tests.fixtures.flavours import FLAVOURS, scenes
from tests.fixtures.shared import both, shared
from tests.logs.making import frames

Rgb = npt.NDArray[np.uint8]

REFUSED = {
    "ros2_CompressedImage_compressedDepth": "it holds depth",
    "ros2_Image_bgr8_shortdata": r"(5084|56600) bytes of pixels where (5184|57600) are needed",
}


def cases(*shows: str) -> pytest.MarkDecorator:
    names = [f"{name}.mcap" for name, flavour in FLAVOURS.items() if flavour.shows in shows]
    return pytest.mark.parametrize("log", both("flavours", *names), indirect=True)


def expected(log: Path, *, grey: bool) -> list[Rgb]:
    """Return the frames that a log was made from: those beside it, or ours."""
    beside = sorted(log.parent.glob("expected_*.png"))
    images = [cv2.imread(str(path))[..., ::-1] for path in beside] if beside else scenes()
    if not grey:
        return images
    return [cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)[..., None].repeat(3, axis=2) for rgb in images]


@pytest.mark.parametrize("folder", shared("mcap", "flavours"))
def test_every_shared_flavour_is_among_ours(folder: Path) -> None:
    assert {path.stem for path in folder.glob("*.mcap")} <= set(FLAVOURS)


@cases("colour", "grey")
def test_frames_are_those_expected(log: Path) -> None:
    flavour, decoded = FLAVOURS[log.stem], frames(log)
    assert len(decoded) == 5
    for frame, image in zip(decoded, expected(log, grey=flavour.shows == "grey"), strict=True):
        assert np.abs(frame.image.astype(int) - image).mean() <= flavour.error


@cases("colour", "grey", "video")
def test_the_cameras_own_name_is_read(log: Path) -> None:
    with open_log(log) as opened:
        assert all(topic.frame_id in {"camera", "cam"} for topic in opened.topics if topic.is_image)


@cases("nothing")
def test_what_is_no_image_is_called_by_its_name(log: Path) -> None:
    with pytest.raises((LogError, FrameError), match=REFUSED[log.stem]):
        frames(log)
