"""KITTI's road benchmark as it is unpacked: the truth, calibrations and grounds of its images."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.data.arrays import Image
from roadeval.images.decoding import size_of, to_rgb
from roadeval.images.formats import Limits
from roadeval.logs.errors import LogError
from roadeval.logs.files import list_files
from roadeval.runtime.files import reading

IMAGES: Final = "image_2"
_SHAPES: Final = {"P2": (3, 4), "R0_rect": (3, 3), "Tr_cam_to_road": (3, 4)}
_VEHICLE: Final = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""The rotation from KITTI's road (right, down, ahead) to a vehicle's axes: ahead, left, up."""


def is_road(folder: Path) -> bool:
    """Return whether a folder has images and calibrations as the benchmark's have."""
    return all((folder / part).is_dir() for part in (IMAGES, "calib"))


def truth_files(folder: Path) -> list[Path]:
    """List the truth of the road, without the truth of the ego lane; test images have none."""
    truth = folder / "gt_image_2"
    files = list_files(truth, {".png"}) if truth.is_dir() else []
    return [file for file in files if "_road_" in file.name]


def road_mask(truth: bytes) -> Image:
    """Return the ``(H, W)`` uint8 mask of a truth file: 255 blue, 0 red alone, 128 without red."""
    red, _, blue = np.moveaxis(to_rgb(truth, Limits()) > 0, 2, 0)
    return np.where(red, 255 * blue, 128).astype(np.uint8)


def messages(folder: Path, name: str, image: bytes, frame_id: str) -> Iterator[tuple[str, Any]]:
    """Yield topics and messages: an image's calibration, and its camera's place over the road.

    The camera is rectified and lies where ``P2`` has it, so its projection is K alone. A `LogError`
    if a matrix of `_SHAPES` is missing, or impossible.
    """
    from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
    from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
    from scipy.spatial.transform import Rotation

    file = folder / "calib" / f"{name}.txt"
    with reading(file, LogError):
        lines = file.read_text(errors="replace").splitlines()
    numbers = {name: rest.split() for name, _, rest in (line.partition(":") for line in lines)}
    matrices = []
    for matrix_name, shape in _SHAPES.items():
        try:
            matrix = np.array(numbers[matrix_name], float).reshape(shape)
        except (KeyError, ValueError) as error:
            line = f"it has no line {matrix_name} of {shape[0] * shape[1]} numbers"
            raise LogError(line, where=file) from error
        turn = matrix[:, :3]
        fits = matrix_name == "P2" or np.allclose(turn @ turn.T, np.eye(3), atol=1e-3)
        if not (fits and np.isfinite(matrix).all() and np.linalg.det(turn) > 0):
            raise LogError(f"the numbers of {matrix_name} fit no camera", where=file)
        matrices.append(matrix)
    projection, rectified, to_road = matrices
    k, turn = projection[:, :3], to_road[:, :3] @ np.linalg.inv(rectified)
    lens: dict[str, Any] = {"K": k.ravel(), "R": np.eye(3).ravel(), "P": (k @ np.eye(3, 4)).ravel()}
    width, height = size_of(image, Limits())
    lens |= {"frame_id": frame_id, "width": width, "height": height}
    yield "/camera/calibration", CameraCalibration(**lens)
    at = _VEHICLE @ (to_road[:, 3] - turn @ np.linalg.solve(k, projection[:, 3]))
    quaternion = Rotation.from_matrix(_VEHICLE @ turn).as_quat()
    pose: dict[str, Any] = {"parent_frame_id": "road", "child_frame_id": frame_id}
    pose["translation"] = dict(zip("xyz", at, strict=True))
    pose["rotation"] = dict(zip("xyzw", quaternion, strict=True))
    yield "/tf_static", FrameTransform(**pose)
