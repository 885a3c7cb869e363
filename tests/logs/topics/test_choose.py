"""Which topics are picked, when the user is asked, and which truth is which camera's of a rig."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from roadeval.logs.errors import LogError
from roadeval.logs.frames import Selection
from roadeval.logs.log import open_log
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.settings import LabelSettings, LogConfig, TopicSettings
from roadeval.logs.topics.choose import choose_image, choose_shadow, choose_truth
from roadeval.logs.topics.reader import TopicInfo
from roadeval.runtime.sentence import name_settings
from tests.logs.making import SECOND, compressed, grey, jpeg, raw, ros2_log


def camera(name: str) -> TopicInfo:
    return TopicInfo(
        name, "CompressedImage", "cdr", TopicKind.COMPRESSED, 5, format="jpeg", channels=3
    )


def label(name: str) -> TopicInfo:
    return TopicInfo(name, "Image", "cdr", TopicKind.IMAGE, 5, format="mono8", channels=1)


def other(name: str) -> TopicInfo:
    return TopicInfo(name, "sensor_msgs/msg/Imu", "cdr", TopicKind.OTHER, 5)


def test_a_topic_that_is_named_for_something_else_is_no_camera():
    topics = [camera("/front/image"), label("/front/road")]
    with pytest.raises(LogError, match="2 image topics: /front/image, /front/road"):
        choose_image(topics, None)
    for settings in (TopicSettings(truth="/front/road"), TopicSettings(masks={"a": "/front/road"})):
        assert choose_image(topics, None, settings.of_labels)[0].name == "/front/image"
    with pytest.raises(LogError, match="2 image topics"):
        choose_image(topics, None, {topic.name for topic in topics})


def test_labels_and_masks_are_no_cameras_and_depth_is_one_where_there_is_nothing_else() -> None:
    topics = [camera("/cam"), label("/labels/semantic"), label("/road_mask"), label("/shadowMask")]
    assert choose_image(topics, None)[0].name == "/cam"
    depth = TopicInfo("/cam/depth", "Image", "cdr", TopicKind.IMAGE, 5, format="16UC1", channels=1)
    assert choose_image([camera("/cam/rgb"), depth], None)[0].name == "/cam/rgb"
    assert choose_image([depth], None)[0].name == "/cam/depth"


def test_a_topic_that_is_not_there_is_guessed_among_those_of_its_kind() -> None:
    topics = [camera("/cam/left"), label("/labels/semantic")]
    with pytest.raises(LogError, match=r"mean /cam/left\? its camera topics are: /cam/left$"):
        choose_image(topics, "/cam")
    with pytest.raises(LogError, match=r"its label topics are: /labels/semantic$"):
        choose_truth(topics, topics[0], "/truth", LabelSettings())


@pytest.mark.parametrize(
    ("names", "chosen"),
    [
        (("/cam/image_raw/compressed", "/cam/image_raw"), "/cam/image_raw"),
        (("/cam/image_raw/theora", "/cam/image_raw/compressed"), "/cam/image_raw/compressed"),
        (("/cam/image_raw/zstd", "/cam/image_raw/compressed"), "/cam/image_raw/zstd"),
    ],
)
def test_transports_of_one_camera_are_one_camera(names: tuple[str, ...], chosen: str) -> None:
    """image_transport's plugins publish below the topic of the raw images; all may be recorded."""
    topics = [
        replace(
            camera(name),
            problem="no image" if name.endswith("theora") else "",
            lossy="JPEG" if name.endswith("compressed") else "",
        )
        for name in names
    ]
    topic, why = choose_image([*topics, label("/road_mask")], None)
    assert (topic.name, why) == (chosen, "the only camera image, of 2 transports")
    with pytest.raises(LogError, match=f"2 image topics: {chosen}, /rear/image_raw;"):
        choose_image([*topics, camera("/rear/image_raw")], None)


def test_an_unknown_topic_lists_the_valid_ones() -> None:
    topics = [camera("/left"), camera("/right"), other("/imu")]
    with pytest.raises(LogError, match=r"/lef is not in the log; .*: /left, /right") as refused:
        choose_image(topics, "/lef")
    assert refused.value.setting == "topics.image"
    with pytest.raises(LogError, match=r"/imu carries no images"):
        choose_image(topics, "/imu")


ROADS = [
    "/labels/semantic",
    "/front/road_mask",
    "/truth/road",
    "/gt",
    "/mask",
    "/front/GroundTruth",
]
OTHERS = ["/ego_mask", "/shadow_mask", "/net/road_mask", "/mono", "/truth/shadow"]


@pytest.mark.parametrize("name", [*ROADS, *OTHERS])
def test_one_plain_label_image_is_the_truth_and_other_masks_are_none(name: str) -> None:
    topics = [camera("/front/image"), label(name)]
    topic = choose_truth(topics, topics[0], None, LabelSettings()).topic
    assert topic == (topics[1] if name in ROADS else None)


def test_shadow_truth_is_told_from_road_truth_by_its_name() -> None:
    topics = [camera("/cam"), label("/truth/road"), label("/truth/shadow")]
    assert choose_truth(topics, topics[0], None, LabelSettings()).topic == topics[1]
    assert choose_shadow(topics, topics[0], None).topic == topics[2]


def test_label_images_with_loss_are_named_or_refused_to_who_says_what_values_mean() -> None:
    topics = [camera("/cam"), replace(label("/cam/road_mask"), lossy="JPEG")]
    topic, why = choose_truth(topics, topics[0], None, LabelSettings())
    assert topic is None
    assert "/cam/road_mask is JPEG, which changes label values" in why
    with pytest.raises(LogError, match=r"/cam/road_mask is JPEG.*: log labels as PNG"):
        choose_truth(topics, topics[0], None, LabelSettings(road=(255,)))


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


def test_the_setting_that_chooses_one_of_several_truths_is_known_as_one(tmp_path: Path) -> None:
    path = rig(tmp_path, {"/image": ""}, {"/labels": "", "/road_mask": ""})
    with pytest.raises(LogError, match="2 label topics: /labels, /road_mask; ") as refused:
        selected(path, "/image")
    flagged = name_settings(refused.value.sentence, {"topics.truth": "--truth-topic"}.get)
    assert flagged.endswith("choose one with --truth-topic")
