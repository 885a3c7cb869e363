"""The calibration of a camera and its mounting, in messages made here and of real writers."""

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

from benchmarks.long_logs import MESSAGES
from roadeval.data import Calibration
from roadeval.geometry.settings import GroundSettings
from roadeval.logs.log import open_log
from roadeval.logs.settings import LogConfig, TopicSettings
from tests.fixtures.shared import shared

STAMP = {"sec": 5, "nanosec": 0}
SIZE = 64, 48
K = [50.0, 0.0, 32.0, 0.0, 51.0, 24.0, 0.0, 0.0, 1.0]
D = [-0.1, 0.01, 0.0, 0.0, 0.0]
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
    frame_id="cam", size=SIZE, binning=(0, 0), roi=(0, 0, 0, 0), model="plumb_bob", **changed: Any
) -> dict[str, Any]:
    """A CameraInfo; ``roi`` are first column and row, width and height; the rest are d, k and p."""
    names = "x_offset", "y_offset", "width", "height"
    numbers = {"d": D, "k": K, "r": [0.0] * 9, "p": [0.0] * 12} | changed
    return {
        "header": header(frame_id),
        "width": size[0],
        "height": size[1],
        "distortion_model": model,
        "binning_x": binning[0],
        "binning_y": binning[1],
        **{name: list(values) for name, values in numbers.items()},
        "roi": {**dict(zip(names, roi, strict=True)), "do_rectify": False},
    }


def moved(at: tuple[float, ...], turn: Rotation) -> dict[str, Any]:
    rotation = dict(zip("xyzw", turn.as_quat().tolist(), strict=True))
    return {"translation": dict(zip("xyz", at, strict=True)), "rotation": rotation}


def transforms(tree: list[Parts]) -> dict[str, Any]:
    return {
        "transforms": [
            {"header": header(parent), "child_frame_id": child, "transform": moved(at, turn)}
            for child, parent, at, turn in tree
        ]
    }


def ros2(
    path: Path,
    infos: dict[str, dict[str, Any] | list[dict[str, Any]]],
    tree: list[Parts] = TREE,
    image_topic: str = "/front/image/compressed",
) -> Path:
    """A log of ROS 2 with one camera."""
    with path.open("wb") as file:
        writer = Ros2Writer(file)
        schemas = {name: writer.register_msgdef(name, text) for name, text in MESSAGES.items()}
        lists = {name: many if isinstance(many, list) else [many] for name, many in infos.items()}
        picture = {"header": header("cam"), "format": "jpeg", "data": image()}
        for topic, kind, message in (
            ("/tf_static", "tf2_msgs/msg/TFMessage", transforms(tree)),
            *(
                (name, "sensor_msgs/msg/CameraInfo", m)
                for name, many in lists.items()
                for m in many
            ),
            (image_topic, "sensor_msgs/msg/CompressedImage", picture),
        ):
            # Logged later than it was taken, as everything is.
            writer.write_message(topic, schemas[kind], message, log_time=5 * 10**9 + 7)
        writer.finish()
    return path


def lens_in(path: Path, topic: str | None = None) -> tuple[Calibration | None, str]:
    with open_log(path, LogConfig(topics=TopicSettings(image=topic))) as log:
        selection = log.select()
        return selection.calibration, selection.calibration_why


def front(
    folder: Path, tree: list[Parts] = TREE, topic="/front/image/compressed", **changed: Any
) -> tuple[Calibration | None, str]:
    """Return what is known of a camera with a CameraInfo that is changed so."""
    return lens_in(ros2(folder / "front.mcap", {"/front/info": info(**changed)}, tree, topic))


def test_a_camera_of_ros_2_is_known_with_its_place_on_the_vehicle(tmp_path: Path):
    lens, _ = front(tmp_path)
    assert (lens.topic, lens.width, lens.height) == ("/front/info", *SIZE)
    assert (lens.matrix, lens.distortion, lens.model) == (tuple(K), tuple(D), "plumb_bob")
    (_, _, at, turn), (_, _, mast_at, mast_turn) = TREE
    assert lens.mounting.parent == "base_link"
    assert lens.mounting.translation == pytest.approx(np.array(mast_at) + mast_turn.apply(at))
    turned = Rotation.from_quat(lens.mounting.rotation)
    assert (turned.inv() * (mast_turn * turn)).magnitude() == pytest.approx(0, abs=1e-12)


Message = tuple[str, str, dict[str, Any]]
"""Topic, kind and content."""
TIME = {"sec": 5, "nsec": 0}


def picture(topic: str = "/front/image") -> Message:
    content = {"timestamp": TIME, "frame_id": "cam", "format": "jpeg", "data": list(image())}
    return topic, "foxglove.CompressedImage", content


def foxglove_lens(focal: float = K[0]) -> Message:
    size = {"width": 64, "height": 48, "distortion_model": "rational_polynomial", "D": D}
    k = [focal, *K[1:]]
    p = [40.0, 0, 30, 0, 0, 41.0, 20, 0, 0, 0, 1, 0]
    content = {"timestamp": TIME, "frame_id": "cam", **size, "K": k, "P": p}
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
    place = {"timestamp": TIME, "parent_frame_id": "car", "child_frame_id": "cam"}
    place |= moved(at, turn)
    messages = [foxglove_lens(), ("/tf_static", "foxglove.FrameTransform", place), picture()]
    lens, _ = lens_in(foxglove(tmp_path / "a.mcap", messages))
    assert (lens.matrix, lens.model) == (tuple(K), "rational_polynomial")
    assert (lens.mounting.parent, lens.mounting.translation) == ("car", at)


@pytest.mark.parametrize("name", ["P", "D", "distortion_model"])
def test_fields_that_are_not_needed_may_be_missing(tmp_path: Path, name: str):
    topic, kind, content = foxglove_lens()
    content = {key: value for key, value in content.items() if key != name}
    lens, _ = lens_in(foxglove(tmp_path / "a.mcap", [(topic, kind, content), picture()]))
    assert lens.matrix == tuple(K)


def test_of_rectified_images_the_projection_holds_without_distortion(tmp_path: Path):
    messages = [foxglove_lens(), picture("/front/image_rect")]
    lens, _ = lens_in(foxglove(tmp_path / "a.mcap", messages))
    assert lens.matrix == (40, 0, 30, 0, 41, 20, 0, 0, 1)
    assert not lens.distortion


def test_a_calibration_that_changes_within_the_log_is_not_used(tmp_path: Path):
    path = foxglove(
        tmp_path / "a.mcap",
        [foxglove_lens(), picture(), foxglove_lens(), foxglove_lens(focal=60.0)],
    )
    assert lens_in(path) == (None, "/front/calibration: it changes within the log")


def test_of_several_the_one_of_the_camera_is_taken(tmp_path: Path):
    for frame_id in ("cam_rear", "cam"):
        infos = {"/rear/info": info(frame_id), "/front/info": info()}
        lens, _ = lens_in(ros2(tmp_path / frame_id, infos))
        assert lens.topic == "/front/info"


def test_a_calibration_may_lie_below_the_topic_of_the_images(tmp_path: Path):
    infos = {f"/rig/{side}/info": info() for side in ("left", "right")}
    lens, _ = lens_in(ros2(tmp_path / "rig.mcap", infos, TREE, "/rig/left"))
    assert lens.topic == "/rig/left/info"


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"k": [0.0] * 9}, "focal length is 0"),
        ({"k": [-50.0, *K[1:]]}, "its focal length is -50 and 51"),
        ({"k": [1e-300, *K[1:]]}, "its focal length is 1e-300"),
        ({"k": [math.nan, *K[1:]]}, "its focal length is nan"),
        ({"k": [*K[:5], 1e300, *K[6:]]}, "its centre is 32, 1e+300"),
        ({"k": [*K[::3], *K[1::3], *K[2::3]]}, "length is not clear"),
        ({"d": [math.inf] * 5}, "its distortion has a number"),
        ({"size": (0, 0)}, "its size is 0x0"),
        ({"size": (128, 72)}, "images of 128x72"),
        ({"binning": (2**32 - 1, 1)}, "its size is 0x48 pixels of its"),
        ({"roi": (32, 0, 64, 48)}, "its region of interest lies outside"),
        ({"frame_id": "rear"}, "none of /front/info is clearly of"),
    ],
)
def test_what_cannot_be_used_is_said_and_not_used(tmp_path, fields, reason):
    lens, why = front(tmp_path, **fields)
    assert lens is None
    assert reason in why


def test_a_log_without_a_calibration_says_nothing(tmp_path):
    assert lens_in(ros2(tmp_path / "a.mcap", {})) == (None, "")


@pytest.mark.parametrize(
    "tree",
    [
        [],
        [("cam", "mast", (0.0,) * 3, TREE[0][3]), ("mast", "cam", (0.0,) * 3, TREE[0][3])],
        [("other", "base_link", (0.0,) * 3, TREE[0][3])],
    ],
)
def test_a_place_that_no_transform_leads_to_is_not_known(tmp_path: Path, tree: list[Parts]):
    lens, _ = front(tmp_path, tree)
    assert lens.mounting is None


@pytest.mark.parametrize(
    ("at", "turn", "reason"),
    [
        ((1.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.5), "mast has a quaternion of length 0.5, not 1"),
        ((1.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0), "mast has a quaternion of length 0, not 1"),
        ((1.0, 0.0, 1.0), (math.nan, 0.0, 0.0, 1.0), "mast has a quaternion of length nan"),
        ((1.0, math.nan, 1.0), (0.0, 0.0, 0.0, 1.0), "mast is moved by 1, nan, 1 m"),
        ((1.0, 0.0, 1e300), (0.0, 0.0, 0.0, 1.0), "mast is moved by 1, 0, 1e+300 m"),
    ],
)
def test_a_transform_that_is_none_is_said_and_not_used(tmp_path, at, turn, reason):
    rotation = SimpleNamespace(as_quat=lambda: np.array(turn))
    tree = [TREE[0], ("mast", "base_link", at, cast("Rotation", rotation))]
    lens, why = front(tmp_path, tree)
    assert lens.mounting is None
    assert why.startswith(f"its place is not known: the transform of {reason}")


def test_a_calibration_of_reduced_frames_projects_to_the_reduced_places():
    lens = Calibration("/c", 64, 48, tuple(K)).scaled(32, 16)
    point = np.array([0.3, -0.2, 2.0])
    full, less = (np.array(m).reshape(3, 3) @ point for m in (K, lens.matrix))
    # The image's corner, half a pixel before the centre of its first one, stays where it is.
    assert less[:2] / less[2] + 0.5 == pytest.approx((full[:2] / full[2] + 0.5) / [2, 3])


@pytest.mark.parametrize(
    ("fields", "matrix"),
    [
        # A corner comes off first, and then all is divided, as in ROS's image_geometry.
        ({"size": (128, 96), "binning": (2, 2), "k": [100.0, 0, 64, 0, 102, 48, 0, 0, 1]}, K),
        ({"size": (64, 144), "roi": (0, 96, 64, 48), "k": [50.0, 0, 32, 0, 51, 120, 0, 0, 1]}, K),
        (
            {
                "size": (512, 384),
                "roi": (100, 200, 128, 144),
                "binning": (2, 3),
                "k": [100.0, 0, 164, 0, 153, 272, 0, 0, 1],
            },
            K,
        ),
        # Pixels' centres are counted: the middle of 128 columns, 63.5, is 31.5 of 64.
        (
            {"size": (128, 96), "binning": (2, 2), "k": [100.0, 0, 63.5, 0, 102, 47.5, 0, 0, 1]},
            [50.0, 0, 31.5, 0, 51, 23.5, 0, 0, 1],
        ),
    ],
)
def test_a_part_of_the_sensor_and_binned_pixels_are_as_ros_means_them(tmp_path, fields, matrix):
    lens, why = front(tmp_path, **fields)
    assert (lens.width, lens.height) == SIZE
    assert lens.matrix == tuple(matrix)
    assert why == ""


@pytest.mark.parametrize(
    ("fields", "focal", "reason"),
    [
        ({"size": (128, 96)}, 25.0, "it is for images of 128x96, and scaled"),
        ({"size": (32, 24)}, 100.0, "it is for images of 32x24, and scaled"),
        ({"binning": (2, 2)}, 50.0, "its region of interest and binning are not those of"),
        ({"roi": (32, 24, 32, 24)}, 50.0, "its region of interest and binning are not those of"),
        ({"k": [100.0, 0, 64, 0, 102, 48, 0, 0, 1]}, 100.0, "its centre, 64, 48, is far from"),
    ],
)
def test_a_lens_of_another_resolution_is_scaled_or_doubted_and_said(
    tmp_path, fields, focal, reason
):
    lens, why = front(tmp_path, **fields)
    assert (lens.width, lens.height, lens.matrix[0]) == (*SIZE, focal)
    assert reason in why


P = [40.0, 0, 30, 0, 0, 41.0, 20, 0, 0, 0, 1, 0]
SAME = [*K[:3], 0.0, *K[3:6], 0.0, *K[6:], 0.0]


@pytest.mark.parametrize(
    ("topic", "fields", "focal", "bends"),
    [
        ("/front/image_rect_color/compressed", {"p": P}, 40.0, False),
        ("/front/rect/image/compressed", {"p": P}, 40.0, False),
        ("/front/rectified/image", {"p": P}, 40.0, False),
        ("/front/imageUndistorted", {"p": P}, 40.0, False),
        ("/front/image_raw", {"p": P}, 50.0, True),
        # RealSense gives this name to images with distortion.
        ("/front/image_rect_raw", {"p": P}, 50.0, True),
        ("/front/image_rect", {"p": SAME}, 50.0, True),
        ("/front/image_rect", {"p": SAME, "d": [0.0] * 5}, 50.0, False),
        ("/front/image_rect", {"d": [0.0] * 5}, 50.0, False),
    ],
)
def test_names_and_numbers_tell_whether_images_are_rectified(tmp_path, topic, fields, focal, bends):
    lens, why = front(tmp_path, topic=topic, **fields)
    assert (lens.matrix[0], lens.bends) == (focal, bends)
    assert ("taken as not rectified" in why) == (fields.get("p") == SAME and bends)


@pytest.mark.parametrize(("degrees", "topic"), [(2.5, "rect"), (0.0, "rect"), (2.5, "raw")])
def test_a_rotation_that_rectifies_is_said_not_to_be_used(tmp_path, degrees, topic):
    turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix().ravel().tolist()
    _, why = front(tmp_path, topic=f"/front/image_{topic}", p=P, r=turn)
    said = "its R turns rectified images by 2.5°, and is not used: cam is taken as the frame of"
    assert (said in why) == (degrees > 0 and topic == "rect")


def test_rectified_images_without_a_projection_have_no_lens(tmp_path: Path):
    why = "its projection P is zero, and the images are rectified: give its lens with `ground`"
    assert front(tmp_path, topic="/front/image_rect") == (None, f"/front/info: {why}")


@pytest.mark.parametrize(
    ("before", "right", "after"), [(1, 1, 0), (2, 1, 1), (40, 60, 0), (300, 1, 0)]
)
def test_messages_of_zeros_are_passed_over(tmp_path: Path, before: int, right: int, after: int):
    zero = info(k=[0.0] * 9, size=(0, 0))
    messages = [*[zero] * before, *[info()] * right, *[zero] * after]
    lens, why = lens_in(ros2(tmp_path / "a.mcap", {"/front/info": messages}))
    assert (lens.matrix, why) == (tuple(K), "")


def test_a_camera_frame_with_the_axes_of_a_vehicle_is_read_so(tmp_path: Path):
    body = Rotation.from_euler("ZYX", [20, 6, 1], degrees=True)
    optical = body * Rotation.from_quat([-0.5, 0.5, -0.5, 0.5])
    images = []
    for turn in (body, optical):
        tree: list[Parts] = [("cam", "base_link", (1.0, 0.0, 1.2), turn)]
        images.append(front(tmp_path, tree))
    (of_body, why), (of_optical, nothing) = images
    for lens in (of_body, of_optical):
        apart = Rotation.from_quat(lens.mounting.rotation).inv() * optical
        assert apart.magnitude() == pytest.approx(0, abs=1e-9)
    assert (why, nothing) == ("cam has the axes of a vehicle, x ahead, and is read as such", "")
    assert (of_body.frame_id, of_optical.frame_id) == ("cam_optical", "cam")


def test_transforms_and_a_calibration_that_cannot_be_read_are_said(tmp_path: Path):
    messages = [foxglove_lens(), ("/tf_static", "foxglove.FrameTransform", {"x": 1}), picture()]
    lens, why = lens_in(foxglove(tmp_path / "a.mcap", messages))
    assert lens is not None
    assert why == "its place is not known: /tf_static cannot be read"
    topic, name, content = foxglove_lens()
    path = foxglove(tmp_path / "a.mcap", [(topic, name, {**content, "K": None}), picture()])
    why = "its json messages of foxglove.CameraCalibration cannot be read: give its lens with"
    assert lens_in(path) == (None, f"/front/calibration: {why} `ground`")


FOLDER = shared("failures", "reality")
PLAIN = [7680, 1760, 960, 480]
"""Pixels of a frame from 0 to 10, 20, 40 and 80 m, by the camera that drew them."""
WRITTEN = (
    "camera_info_binning.mcap",
    "camera_info_roi.mcap",
    "camera_info_no_schema_text.mcap",
    "camera_info_omgidl.mcap",
    "calibration_flatbuffer.mcap",
    "ros1_converted",
    "ros1_converted_renamed",
)


@pytest.mark.parametrize("folder", FOLDER)
@pytest.mark.parametrize("name", WRITTEN)
def test_the_lens_is_the_same_whoever_wrote_it(folder, name: str):
    with open_log(folder / "writers" / name, LogConfig(topics=TopicSettings(truth=""))) as log:
        known = log.select().calibration
    assert (known.matrix[0], known.matrix[2], known.width) == (80, 48, 96)


@pytest.mark.parametrize("folder", FOLDER)
@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        *((name, (1.5, 4.0), PLAIN) for name in ("plain", "binned", "roi", "tf_body")),
        *((name, (1.5, 4.0), PLAIN) for name in ("tf_optical", "rect_flat", "rect_nested")),
        ("fish_zero", (1.2, 20.0), [9692, 386, 192, 102]),
    ],
)
def test_pixels_lie_at_the_distances_at_which_they_were_drawn(folder, name, given, expected):
    config = LogConfig(ground=GroundSettings(height=given[0], pitch=given[1]))
    with open_log(folder / "cameras" / f"{name}.mcap", config) as log:
        ground = log.select().ground
    pixels = np.indices((ground.width, ground.height)).reshape(2, -1).T.astype(float)
    ahead = ground.places(pixels)[:, 0]
    bands = ((0, 10), (10, 20), (20, 40), (40, 80))
    assert [int(((ahead >= near) & (ahead < far)).sum()) for near, far in bands] == expected


@pytest.mark.parametrize("folder", FOLDER)
def test_pixels_beyond_the_fold_of_a_polynomial_lie_nowhere(folder):
    with open_log(
        folder / "cameras" / "fold.mcap", LogConfig(ground=GroundSettings(height=1.5, pitch=4.0))
    ) as log:
        ground = log.select().ground
    pixels = np.indices((ground.width, ground.height)).reshape(2, -1).T.astype(float)
    assert abs(np.isnan(ground.rays(pixels)[:, 0]).sum() - 2096) <= 8


@pytest.mark.parametrize("folder", FOLDER)
def test_a_lens_without_a_name_is_named_so_twice(folder):
    topics = TopicSettings(truth="")
    with open_log(folder / "times" / "ci_nomodel4.mcap", LogConfig(topics=topics)) as log:
        reasons = "\n".join(log.select().reasons)
    assert "(a nameless distortion)" in reasons
    assert "without a name of 4 numbers" in reasons
