"""Files of calibration tools as the camera of a run."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from roadeval.config.camera_file import read_camera
from roadeval.config.run import configure
from roadeval.config.tables import ConfigError
from roadeval.geometry.settings import GroundSettings

OST = """\
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [560.5, 0, 318., 0.0, 561.25, 241, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.3, 0.1, 1e-05, -0.002, 0.000000]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [500.0, 0.0, 318.0, 0.0, 0.0, 500.0, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0]
"""
FRONT: dict[str, Any] = {
    "cam_overlaps": [1],
    "camera_model": "pinhole",
    "distortion_coeffs": [-0.01, 0.002, 0.0, 1e-05],
    "distortion_model": "equidistant",
    "intrinsics": [460.0, 461.0, 380.0, 250.0],
    "resolution": [752, 480],
    "rostopic": "/cam0/image_raw",
}
REAR = {**FRONT, "intrinsics": [400.0, 400.0, 370.0, 240.0], "rostopic": "/cam1/image_raw"}


def given(folder: Path, text: str, topic: str | None = None) -> GroundSettings:
    path = folder / "camera.yaml"
    path.write_text(text)
    return configure({"ground": read_camera(path, topic)}).ground


def test_the_file_of_ros_is_read(tmp_path: Path):
    assert given(tmp_path, f"{OST}height: 1.4\npitch: 3\n") == GroundSettings(
        height=1.4,
        pitch=3.0,
        size=(640, 480),
        focal=(560.5, 561.25),
        centre=(318.0, 241.0),
        model="plumb_bob",
        distortion=(-0.3, 0.1, 1e-5, -0.002, 0.0),
    )


def test_the_file_of_kalibr_is_read(tmp_path: Path):
    text = yaml.dump({"cam0": FRONT})
    assert given(tmp_path, text) == GroundSettings(
        size=(752, 480),
        focal=(460.0, 461.0),
        centre=(380.0, 250.0),
        model="equidistant",
        distortion=(-0.01, 0.002, 0.0, 1e-5),
    )


def test_of_several_cameras_the_topic_of_the_images_tells_which(tmp_path: Path):
    text = yaml.dump({"cam0": FRONT}) + yaml.dump({"cam1": REAR})
    assert given(tmp_path, text, "/cam1/image_raw/compressed").focal == (400.0, 400.0)
    with pytest.raises(ConfigError, match=r"several cameras, cam0 \(/cam0/image_raw\), cam1"):
        given(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (yaml.dump({"cam0": {**FRONT, "camera_model": "omni"}}), "cam0 is of the model omni"),
        (OST.replace("-0.3", ".nan"), "ground.distortion: item 1"),
        (OST.replace("560.5", "-1"), "ground.focal: item 1"),
        (OST.replace("560.5", "fx"), "no camera as ROS's camera_calibration"),
        (OST.replace("image_width: 640", "image_width: [640]"), "ground.size: item 1"),
        (OST.replace("  data: [560.5", "  dates: [560.5"), "no camera as ROS's camera_calibration"),
        (yaml.dump({"cam0": {**FRONT, "intrinsics": []}}), "no camera as ROS's"),
        ("- 1\n- 2\n", "no camera as ROS's camera_calibration"),
        ("", "no camera as ROS's camera_calibration"),
        ("a: &x [1, 1]\nb: [*x, *x]\n", "it has aliases"),
        ("[" * 60_000, "cannot be read as YAML: it nests more than 32"),
        (f"{OST}#{'x' * 200_000}", "at most 131,072 are read"),
        ("!!python/object/apply:os.system ['true']", "cannot be read as YAML"),
        ("a: [1\nb: }", "cannot be read as YAML"),
    ],
)
def test_what_is_no_camera_is_refused_in_one_line(tmp_path: Path, text: str, message: str):
    with pytest.raises(ConfigError) as error:
        given(tmp_path, text)
    assert message in str(error.value).replace("`", "")
    assert "\n" not in str(error.value)
