"""The camera of a run in a file: TOML, ROS's ``ost.yaml``, or Kalibr's ``camchain.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from roadeval.config.tables import ConfigError, read_tables
from roadeval.runtime.documents import read_yaml
from roadeval.runtime.sentence import Sentence


def read_camera(path: str | Path, topic: str | None = None) -> dict[str, Any]:
    """Return the settings of `ground` from a file; ``topic`` chooses one of several cameras.

    The user may add ``height``, ``pitch`` and ``roll`` to a calibration tool's file. A
    `ConfigError` if the file has no usable camera, or it is not clear which one is meant.
    """
    if Path(path).suffix.lower() not in (".yaml", ".yml"):
        return read_tables(path)
    try:
        document = read_yaml(Path(path))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(f"cannot be read as YAML: {reason}", where=path) from error
    try:
        if "camera_matrix" in document:
            matrix = document["camera_matrix"]["data"]
            size = document["image_width"], document["image_height"]
            # Files of old versions do not name the model; ROS assumes this one.
            model = document.get("distortion_model") or "plumb_bob"
            distortion = document["distortion_coefficients"]["data"]
            lens = matrix[0], matrix[4], matrix[2], matrix[5]
        else:
            camera = _choose_camera(path, document, f"{topic}/")
            size, lens = camera["resolution"], camera["intrinsics"]
            model, distortion = camera["distortion_model"], camera["distortion_coeffs"]
        # PyYAML reads 1e-05, which has no point, as text.
        fx, fy, *centre = map(float, lens)
        numbers = {"focal": [fx, fy], "centre": centre, "distortion": [*map(float, distortion)]}
        settings = {"size": [*size], "model": model, **numbers}
        mounted = {name: document[name] for name in ("height", "pitch", "roll") if name in document}
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise ConfigError(
            "no camera as ROS's camera_calibration (ost.yaml) or Kalibr (camchain.yaml) writes it",
            where=path,
            remedy="give its height, pitch and lens in a TOML file",
        ) from error
    return {**settings, **mounted}


def _choose_camera(path: str | Path, document: Mapping[str, Any], topic: str) -> Mapping[str, Any]:
    """Return the pinhole camera of Kalibr's file that is on ``topic``, or the only camera."""
    chain = {name: camera for name, camera in document.items() if "cam" in name}
    topics = {name: str(camera.get("rostopic", "")) for name, camera in chain.items()}
    names = [name for name, begin in topics.items() if begin and topic.startswith(f"{begin}/")]
    name, *others = names or topics
    if others:
        cameras = ", ".join(f"{name} ({camera_topic})" for name, camera_topic in topics.items())
        choose = Sentence("choose one with {topics.image}")
        raise ConfigError(f"several cameras, {cameras}", where=path, remedy=choose)
    camera: Mapping[str, Any] = chain[name]
    if camera["camera_model"] != "pinhole":
        problem = f"{name} has the camera model {camera['camera_model']}"
        raise ConfigError(problem, where=path, remedy="calibrate it as a pinhole camera")
    return camera
