"""The camera of a run in a file: TOML, ROS's ``ost.yaml``, or Kalibr's ``camchain.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from roadeval.config.tables import ConfigError, read_tables
from roadeval.runtime.documents import read_yaml
from roadeval.runtime.sentence import Sentence


def read_camera(path: str | Path, topic: str | None = None) -> dict[str, Any]:
    """Read settings of `ground`; of several cameras in a file those of the images' ``topic``.

    ``height``, ``pitch`` and ``roll`` may stand in a tool's file, too: the tools do not know them.
    A `ConfigError` if there are none to read, or it is not clear which.
    """
    if Path(path).suffix.lower() not in (".yaml", ".yml"):
        return read_tables(path)
    try:
        document = read_yaml(Path(path))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(f"{path}: cannot be read as YAML: {reason}") from error
    try:
        is_of_ros = "camera_matrix" in document
        lens = _of_ros(document) if is_of_ros else _of_kalibr(path, document, f"{topic}/")
        mounted = {name: document[name] for name in ("height", "pitch", "roll") if name in document}
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise ConfigError(
            f"{path}: no camera as ROS's camera_calibration (ost.yaml) or Kalibr (camchain.yaml) "
            "writes it; give its height, pitch and lens in a TOML file"
        ) from error
    return {**lens, **mounted}


def _of_ros(document: Mapping[str, Any]) -> dict[str, Any]:
    matrix = document["camera_matrix"]["data"]
    size = document["image_width"], document["image_height"]
    # Files of old versions do not name the model; ROS takes them so.
    model = document.get("distortion_model") or "plumb_bob"
    distortion = document["distortion_coefficients"]["data"]
    return _settings(size, (matrix[0], matrix[4], matrix[2], matrix[5]), model, distortion)


def _of_kalibr(path: str | Path, document: Mapping[str, Any], topic: str) -> dict[str, Any]:
    chain = {name: camera for name, camera in document.items() if "cam" in name}
    places = {name: str(camera.get("rostopic", "")) for name, camera in chain.items()}
    own = [name for name, place in places.items() if place and topic.startswith(f"{place}/")]
    if len(own := own or [*places]) > 1:
        names = ", ".join(f"{name} ({place})" for name, place in places.items())
        choose = Sentence("choose one with {topics.image}")
        raise ConfigError(f"several cameras, {names}", where=path, remedy=choose)
    camera = chain[own[0]]
    if camera["camera_model"] != "pinhole":
        raise ConfigError(f"{path}: {own[0]} is of the model {camera['camera_model']}, no pinhole")
    model, distortion = camera["distortion_model"], camera["distortion_coeffs"]
    return _settings(camera["resolution"], camera["intrinsics"], model, distortion)


def _settings(size: Any, lens: Any, model: Any, distortion: Any) -> dict[str, Any]:
    # To PyYAML 1e-05, which has no point, is a text.
    fx, fy, *centre = map(float, lens)
    numbers = {"focal": [fx, fy], "centre": centre, "distortion": [*map(float, distortion)]}
    return {"size": [*size], "model": model, **numbers}
