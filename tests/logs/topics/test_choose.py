"""Which topics are picked, and when the user is asked."""

from dataclasses import replace

import pytest

from roadeval.logs.errors import LogError
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.settings import LabelSettings
from roadeval.logs.topics.choose import choose_image, choose_shadow, choose_truth
from roadeval.logs.topics.reader import TopicInfo


def camera(name: str) -> TopicInfo:
    return TopicInfo(
        name, "CompressedImage", "cdr", TopicKind.COMPRESSED, 5, format="jpeg", channels=3
    )


def label(name: str) -> TopicInfo:
    return TopicInfo(name, "Image", "cdr", TopicKind.IMAGE, 5, format="mono8", channels=1)


def other(name: str) -> TopicInfo:
    return TopicInfo(name, "sensor_msgs/msg/Imu", "cdr", TopicKind.OTHER, 5)


def test_labels_and_masks_are_no_cameras() -> None:
    topics = [camera("/cam"), label("/labels/semantic"), label("/road_mask"), label("/shadowMask")]
    assert choose_image(topics, None)[0].name == "/cam"


def test_depth_is_picked_only_where_there_is_nothing_else() -> None:
    depth = TopicInfo("/cam/depth", "Image", "cdr", TopicKind.IMAGE, 5, format="16UC1", channels=1)
    assert choose_image([camera("/cam/rgb"), depth], None)[0].name == "/cam/rgb"
    assert choose_image([depth], None)[0].name == "/cam/depth"


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
