"""A rig of several cameras: no camera is scored against another one's truth."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from roadeval.logs.errors import LogError
from roadeval.logs.frames import Selection
from roadeval.logs.log import open_log
from roadeval.logs.settings import LogConfig, TopicSettings
from tests.logs.making import SECOND, compressed, grey, jpeg, raw, ros2_log

FRONT = "/camera/front/image_raw/compressed"
REAR = "/camera/rear_left/image_raw/compressed"


def rig(folder: Path, cameras: Mapping[str, str], labels: Mapping[str, str]) -> Path:
    """Write three images and masks of each topic, which is given with its ``frame_id``."""
    messages = []
    for stamp in range(SECOND, 4 * SECOND, SECOND):
        for topic, frame_id in cameras.items():
            image = compressed(stamp, jpeg(grey(90)))
            messages.append((topic, stamp, named(image, frame_id)))
        for topic, frame_id in labels.items():
            messages.append((topic, stamp, named(raw(stamp, grey(255), "mono8"), frame_id)))
    return ros2_log(folder / "rig.mcap", messages)


def named(message: dict, frame_id: str) -> dict:
    return message | {"header": message["header"] | {"frame_id": frame_id}}


def selected(path: Path, image: str, truth: str | None = None) -> Selection:
    asked = LogConfig(topics=TopicSettings(image=image, truth=truth))
    with open_log(path, asked) as log:
        return log.select()


def truth(path: Path, image: str, asked: str | None = None) -> str | None:
    found = selected(path, image, asked).truth
    return found.where if found else None


def test_another_cameras_truth_is_refused_by_its_path(tmp_path: Path) -> None:
    path = rig(tmp_path, {FRONT: "", REAR: ""}, {"/camera/front/labels": ""})
    assert truth(path, FRONT) == "/camera/front/labels"
    with pytest.raises(LogError, match=rf"/camera/front/labels belongs to another.*{REAR}.* path"):
        truth(path, REAR)


def test_another_cameras_truth_is_refused_by_its_frame_id(tmp_path: Path) -> None:
    path = rig(tmp_path, {"/a/image": "front", "/b/image": "rear"}, {"/labels/semantic": "front"})
    assert truth(path, "/a/image") == "/labels/semantic"
    with pytest.raises(LogError, match=r"frame_id \(front, not rear\)"):
        truth(path, "/b/image")


def test_of_two_truths_the_cameras_own_is_taken(tmp_path: Path) -> None:
    cameras = {"/one": "cam1", "/two": "cam2"}
    path = rig(tmp_path, cameras, {"/labels/a": "cam1", "/labels/b": "cam2"})
    assert truth(path, "/one") == "/labels/a"
    assert truth(path, "/two") == "/labels/b"


@pytest.mark.parametrize(
    ("camera", "labels", "belong"),
    [
        ({"/camera/image_raw": "camera"}, {"/labels/semantic": "labels"}, True),
        ({"/camera/image": "camera_optical"}, {"/front/road_mask": "base_link"}, True),
        ({"/front/left/image": ""}, {"/front/labels": ""}, True),
        ({"/rear/image": ""}, {"/front/labels": ""}, False),
        ({"/image": "camera_1"}, {"/labels": "camera_2"}, False),
        ({"/image": "CAM_BACK"}, {"/labels": "CAM_FRONT"}, False),
        ({"/cam0/image": ""}, {"/cam1/labels": ""}, False),
    ],
)
def test_the_only_camera_takes_a_truth_that_names_no_other(tmp_path, camera, labels, belong):
    path, (image,), (label,) = rig(tmp_path, camera, labels), camera, labels
    if belong:
        assert truth(path, image) == label
    else:
        with pytest.raises(LogError, match="belongs to another camera"):
            truth(path, image)


def test_a_camera_whose_name_is_part_of_anothers_has_its_own_truth(tmp_path: Path) -> None:
    cameras = {"/CAM_FRONT/image_rect": "", "/CAM_FRONT_LEFT/image_rect": ""}
    path = rig(tmp_path, cameras, {"/CAM_FRONT/annotations": "", "/CAM_FRONT_LEFT/annotations": ""})
    assert truth(path, "/CAM_FRONT/image_rect") == "/CAM_FRONT/annotations"
    assert truth(path, "/CAM_FRONT_LEFT/image_rect") == "/CAM_FRONT_LEFT/annotations"
    path = rig(tmp_path, cameras, {"/CAM_FRONT/annotations": ""})
    with pytest.raises(LogError, match="belongs to another camera"):
        truth(path, "/CAM_FRONT_LEFT/image_rect")


def test_a_coded_camera_and_its_raw_images_are_one(tmp_path: Path) -> None:
    cameras = {"/front/image_raw": "front", "/front/image_raw/compressed": "front"}
    path = rig(tmp_path, cameras, {"/front/labels/compressed": "front"})
    assert {truth(path, camera) for camera in cameras} == {"/front/labels/compressed"}


def test_another_cameras_shadow_is_left_out(tmp_path: Path) -> None:
    path = rig(tmp_path, {FRONT: "", REAR: ""}, {"/camera/front/shadow_mask": ""})
    assert selected(path, FRONT).shadow is not None
    assert selected(path, REAR).shadow is None
