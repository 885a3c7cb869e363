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


def selected(path: Path, image: str) -> Selection:
    with open_log(path, LogConfig(topics=TopicSettings(image=image))) as log:
        return log.select()


REFUSED = "belongs to another camera"
NUSCENES = {"/CAM_FRONT/image_rect": "", "/CAM_FRONT_LEFT/image_rect": ""}


@pytest.mark.parametrize(
    ("cameras", "labels", "truths"),
    [
        # By their paths, by their frames, and each of two cameras its own.
        (
            {FRONT: "", REAR: ""},
            {"/camera/front/labels": ""},
            {FRONT: "/camera/front/labels", REAR: rf"{REFUSED} than {REAR}, by its path"},
        ),
        (
            {"/a/image": "front", "/b/image": "rear"},
            {"/labels/semantic": "front"},
            {"/a/image": "/labels/semantic", "/b/image": r"frame_id \(front, not rear\)"},
        ),
        (
            {"/one": "cam1", "/two": "cam2"},
            {"/labels/a": "cam1", "/labels/b": "cam2"},
            {"/one": "/labels/a", "/two": "/labels/b"},
        ),
        # The only camera takes a truth that names no other.
        ({"/camera/image_raw": "camera"}, {"/labels/semantic": "labels"}, "/labels/semantic"),
        (
            {"/camera/image": "camera_optical"},
            {"/front/road_mask": "base_link"},
            "/front/road_mask",
        ),
        ({"/front/left/image": ""}, {"/front/labels": ""}, "/front/labels"),
        ({"/rear/image": ""}, {"/front/labels": ""}, REFUSED),
        ({"/image": "camera_1"}, {"/labels": "camera_2"}, REFUSED),
        ({"/image": "CAM_BACK"}, {"/labels": "CAM_FRONT"}, REFUSED),
        ({"/cam0/image": ""}, {"/cam1/labels": ""}, REFUSED),
        # The name of a camera may be part of another's.
        (
            NUSCENES,
            {"/CAM_FRONT/annotations": "", "/CAM_FRONT_LEFT/annotations": ""},
            {camera: camera.replace("image_rect", "annotations") for camera in NUSCENES},
        ),
        (NUSCENES, {"/CAM_FRONT/annotations": ""}, {"/CAM_FRONT_LEFT/image_rect": REFUSED}),
        # A coded camera and its raw images are one.
        (
            {"/front/image_raw": "front", "/front/image_raw/compressed": "front"},
            {"/front/labels/compressed": "front"},
            "/front/labels/compressed",
        ),
    ],
)
def test_a_camera_is_scored_against_its_own_truth_alone(tmp_path, cameras, labels, truths):
    path = rig(tmp_path, cameras, labels)
    if isinstance(truths, str):
        truths = dict.fromkeys(cameras, truths)
    for image, truth in truths.items():
        if truth in labels:
            assert selected(path, image).truth.where == truth
        else:
            with pytest.raises(LogError, match=truth):
                selected(path, image)


def test_another_cameras_shadow_is_left_out(tmp_path: Path) -> None:
    path = rig(tmp_path, {FRONT: "", REAR: ""}, {"/camera/front/shadow_mask": ""})
    assert selected(path, FRONT).shadow is not None
    assert selected(path, REAR).shadow is None
