"""The calibration of a camera and its mounting, in the messages of three kinds of writers."""

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest
from mcap.writer import Writer
from mcap_ros2.writer import Writer as Ros2Writer
from scipy.spatial.transform import Rotation

from roadeval.data import Calibration
from roadeval.logs import LogConfig, TopicSettings, open_log

LINE = "=" * 80
STAMP = {"sec": 5, "nanosec": 0}
SIZE = 64, 48
K = [50.0, 0.0, 32.0, 0.0, 51.0, 24.0, 0.0, 0.0, 1.0]
D = [-0.1, 0.01, 0.0, 0.0, 0.0]
HEADER = f"""{LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{LINE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
GEOMETRY = f"""{LINE}
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
{LINE}
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
{LINE}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{LINE}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""
TEXTS = {
    "sensor_msgs/msg/CompressedImage": (
        f"std_msgs/Header header\nstring format\nuint8[] data\n{HEADER}"
    ),
    "sensor_msgs/msg/CameraInfo": (
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\n"
        f"float64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\n{HEADER}"
    ),
    "tf2_msgs/msg/TFMessage": f"geometry_msgs/TransformStamped[] transforms\n{GEOMETRY}{HEADER}",
}
Parts = tuple[str, str, tuple[float, ...], Rotation]
"""A transform: the child, its parent, and translation and rotation in it."""
TREE: list[Parts] = [
    ("cam", "mast", (0.1, 0.0, 0.5), Rotation.from_euler("zyx", (90, 10, -90), degrees=True)),
    ("mast", "base_link", (1.0, -0.2, 1.0), Rotation.from_euler("z", 30, degrees=True)),
]


def header(frame_id: str) -> dict[str, Any]:
    return {"stamp": STAMP, "frame_id": frame_id}


def image() -> bytes:
    return cv2.imencode(".jpg", np.zeros((*SIZE[::-1], 3), np.uint8))[1].tobytes()


def info(
    frame_id: str = "cam",
    k: list[float] = K,
    size: tuple[int, int] = SIZE,
    d: list[float] = D,
) -> dict[str, Any]:
    width, height = size
    lens = {"distortion_model": "plumb_bob", "d": d, "k": k, "r": [0.0] * 9, "p": [0.0] * 12}
    return {"header": header(frame_id), "height": height, "width": width, **lens}


def transforms(tree: list[Parts]) -> dict[str, Any]:
    return {
        "transforms": [
            {
                "header": header(parent),
                "child_frame_id": child,
                "transform": {
                    "translation": dict(zip("xyz", at, strict=True)),
                    "rotation": dict(zip("xyzw", turn.as_quat().tolist(), strict=True)),
                },
            }
            for child, parent, at, turn in tree
        ]
    }


def ros2(
    path: Path,
    infos: dict[str, dict[str, Any]],
    tree: list[Parts] = TREE,
) -> Path:
    """A log of ROS 2 with one camera on /front/image/compressed."""
    with path.open("wb") as file:
        writer = Ros2Writer(file)
        schemas = {name: writer.register_msgdef(name, text) for name, text in TEXTS.items()}

        def add(topic: str, kind: str, message: dict[str, Any]) -> None:
            # Logged later than it was taken, as everything is.
            writer.write_message(topic, schemas[kind], message, log_time=5 * 10**9 + 7)

        add("/tf_static", "tf2_msgs/msg/TFMessage", transforms(tree))
        for topic, message in infos.items():
            add(topic, "sensor_msgs/msg/CameraInfo", message)
        picture = {"header": header("cam"), "format": "jpeg", "data": image()}
        add("/front/image/compressed", "sensor_msgs/msg/CompressedImage", picture)
        writer.finish()
    return path


def found(path: Path, topic: str | None = None) -> tuple[Calibration | None, str]:
    with open_log(path, LogConfig(topics=TopicSettings(image=topic))) as log:
        selection = log.select()
        return selection.calibration, selection.calibration_why


def test_a_camera_of_ros_2_is_known_with_its_place_on_the_vehicle(tmp_path: Path):
    known, _ = found(ros2(tmp_path / "a.mcap", {"/front/camera_info": info()}))
    assert known is not None
    assert known.mounting is not None
    assert (known.topic, known.width, known.height) == ("/front/camera_info", *SIZE)
    assert (known.matrix, known.distortion, known.model) == (tuple(K), tuple(D), "plumb_bob")
    (_, _, at, turn), (_, _, mast_at, mast_turn) = TREE
    assert known.mounting.parent == "base_link"
    assert known.mounting.translation == pytest.approx(np.array(mast_at) + mast_turn.apply(at))
    turned = Rotation.from_quat(known.mounting.rotation)
    assert (turned.inv() * (mast_turn * turn)).magnitude() == pytest.approx(0, abs=1e-12)


Message = tuple[str, str, dict[str, Any]]
"""Topic, kind and content."""
TIME = {"sec": 5, "nsec": 0}


def picture(topic: str = "/front/image") -> Message:
    content = {"timestamp": TIME, "frame_id": "cam", "format": "jpeg", "data": list(image())}
    return topic, "foxglove.CompressedImage", content


def lens(focal: float = K[0]) -> Message:
    known = {"width": 64, "height": 48, "distortion_model": "rational_polynomial", "D": D}
    k = [focal, *K[1:]]
    p = [40.0, 0, 30, 0, 0, 41.0, 20, 0, 0, 0, 1, 0]
    content = {"timestamp": TIME, "frame_id": "cam", **known, "K": k, "P": p}
    return "/front/calibration", "foxglove.CameraCalibration", content


def foxglove(path: Path, messages: list[Message]) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channels: dict[str, int] = {}
        for topic, name, content in messages:
            if topic not in channels:
                schema = writer.register_schema(name, "jsonschema", b"{}")
                channels[topic] = writer.register_channel(topic, "json", schema)
            when = 5 * 10**9
            writer.add_message(channels[topic], when, json.dumps(content).encode(), when)
        writer.finish()
    return path


def test_a_camera_of_foxglove_is_known(tmp_path: Path):
    (_, _, at, turn), _ = TREE
    place = {
        "timestamp": TIME,
        "parent_frame_id": "car",
        "child_frame_id": "cam",
        "translation": dict(zip("xyz", at, strict=True)),
        "rotation": dict(zip("xyzw", turn.as_quat().tolist(), strict=True)),
    }
    messages = [lens(), ("/tf_static", "foxglove.FrameTransform", place), picture()]
    known, _ = found(foxglove(tmp_path / "a.mcap", messages))
    assert known is not None
    assert known.mounting is not None
    assert (known.matrix, known.model) == (tuple(K), "rational_polynomial")
    assert (known.mounting.parent, known.mounting.translation) == ("car", at)


def test_of_rectified_images_the_projection_holds_without_distortion(tmp_path: Path):
    messages = [lens(), picture("/front/image_rect")]
    known, _ = found(foxglove(tmp_path / "a.mcap", messages))
    assert known is not None
    assert known.matrix == (40, 0, 30, 0, 41, 20, 0, 0, 1)
    assert not known.distortion


def test_a_calibration_that_changes_within_the_log_is_not_used(tmp_path: Path):
    messages = [lens(), picture(), lens(), lens(focal=60.0)]
    path = foxglove(tmp_path / "a.mcap", messages)
    assert found(path) == (None, "/front/calibration: it changes within the log")


def test_of_several_the_one_of_the_camera_is_taken(tmp_path: Path):
    infos = {"/rear/camera_info": info("cam_rear"), "/front/camera_info": info()}
    known, _ = found(ros2(tmp_path / "a.mcap", infos))
    assert known is not None
    assert known.topic == "/front/camera_info"
    infos = {"/rear/camera_info": info(), "/front/camera_info": info()}
    known, _ = found(ros2(tmp_path / "b.mcap", infos))
    assert known is not None
    assert known.topic == "/front/camera_info"


@pytest.mark.parametrize(
    ("infos", "said"),
    [
        ({"/front/camera_info": info(k=[0.0] * 9)}, "focal length is 0"),
        ({"/front/camera_info": info(k=[-50.0, *K[1:]])}, "its focal length is -50 and 51"),
        ({"/front/camera_info": info(k=[1e-300, *K[1:]])}, "its focal length is 1e-300"),
        ({"/front/camera_info": info(k=[math.nan, *K[1:]])}, "its focal length is nan"),
        ({"/front/camera_info": info(k=[*K[:5], 1e300, *K[6:]])}, "its centre is 32, 1e+300"),
        ({"/front/camera_info": info(k=[*K[::3], *K[1::3], *K[2::3]])}, "length is not clear"),
        ({"/front/camera_info": info(d=[math.inf] * 5)}, "its distortion has a number"),
        ({"/front/camera_info": info(size=(0, 0))}, "its size is 0x0"),
        ({"/front/camera_info": info(size=(128, 96))}, "images of 128x96"),
        ({"/rear/camera_info": info("cam_rear")}, "none of /rear/camera_info is clearly of"),
        ({}, ""),
    ],
)
def test_what_cannot_be_used_is_said_and_not_used(tmp_path: Path, infos: Any, said: str):
    known, why = found(ros2(tmp_path / "a.mcap", infos))
    assert known is None
    assert said in why
    assert bool(said) == bool(why)


@pytest.mark.parametrize(
    "tree",
    [
        [],
        [("cam", "mast", (0.0,) * 3, TREE[0][3]), ("mast", "cam", (0.0,) * 3, TREE[0][3])],
        [("other", "base_link", (0.0,) * 3, TREE[0][3])],
    ],
)
def test_a_place_that_no_transform_leads_to_is_not_known(tmp_path: Path, tree: list[Parts]):
    known, _ = found(ros2(tmp_path / "a.mcap", {"/front/camera_info": info()}, tree))
    assert known is not None
    assert known.mounting is None


@pytest.mark.parametrize(
    ("at", "turn", "said"),
    [
        ((1.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.5), "mast has a quaternion of length 0.5, not 1"),
        ((1.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0), "mast has a quaternion of length 0, not 1"),
        ((1.0, 0.0, 1.0), (math.nan, 0.0, 0.0, 1.0), "mast has a quaternion of length nan"),
        ((1.0, math.nan, 1.0), (0.0, 0.0, 0.0, 1.0), "mast is moved by 1, nan, 1 m"),
        ((1.0, 0.0, 1e300), (0.0, 0.0, 0.0, 1.0), "mast is moved by 1, 0, 1e+300 m"),
    ],
)
def test_a_transform_that_is_none_is_said_and_not_used(
    tmp_path: Path, at: tuple[float, ...], turn: tuple[float, ...], said: str
):
    rotation = SimpleNamespace(as_quat=lambda: np.array(turn))
    tree = [TREE[0], ("mast", "base_link", at, cast("Rotation", rotation))]
    known, why = found(ros2(tmp_path / "a.mcap", {"/front/camera_info": info()}, tree))
    assert known is not None
    assert known.mounting is None
    assert why.startswith(f"its place is not known: the transform of {said}")


def test_a_calibration_of_reduced_frames_projects_to_the_reduced_places():
    known = Calibration("/c", 64, 48, tuple(K)).scaled(32, 16)
    point = np.array([0.3, -0.2, 2.0])
    whole, less = (np.array(m).reshape(3, 3) @ point for m in (K, known.matrix))
    # The image's corner, half a pixel before the centre of its first one, stays where it is.
    assert less[:2] / less[2] + 0.5 == pytest.approx((whole[:2] / whole[2] + 0.5) / [2, 3])
