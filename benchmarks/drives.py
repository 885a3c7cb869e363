"""The drives that are measured: a log's own frames, brought to a size, in the containers there are.

Sizes are made by resizing, so that every size shows the same scenes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle, islice
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from mcap_ros2.writer import Writer

from roadeval.config.run import configure
from roadeval.data import Frame
from roadeval.logs.log import open_log
from roadeval.logs.writing.writer import LogWriter

PERIOD_NS: Final = 100_000_000
JPEG_QUALITY: Final = 90
FORMS: Final = ("protobuf jpeg", "protobuf png", "ros2 jpeg", "ros2 raw")

HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
NESTED = (
    f"\n{'=' * 80}\nMSG: std_msgs/Header\n{HEADER}"
    f"\n{'=' * 80}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
COMPRESSED = f"std_msgs/Header header\nstring format\nuint8[] data\n{NESTED}"
_RAW = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\n"
    f"uint8 is_bigendian\nuint32 step\nuint8[] data\n{NESTED}"
)


@dataclass(frozen=True)
class Source:
    """A log, and which values of its truth mean road and which to ignore."""

    path: Path
    road: tuple[int, ...] = ()
    ignore: tuple[int, ...] = ()

    def frames(self, count: int) -> list[Frame]:
        """Decode the first frames that have a truth."""
        config = configure({"labels": {"road": self.road, "ignore": self.ignore}})
        with open_log(self.path, config) as log:
            readable = (frame for frame in log.frames(log.select()) if frame.labelled)
            return [each.decode() for each in islice(readable, count)]


def resized(frame: Frame, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Bring an image and its truth to a size: ``(H, W, 3)`` RGB and ``(H, W)``."""
    image = cv2.resize(frame.image, (width, height), interpolation=cv2.INTER_LINEAR)
    truth = cv2.resize(frame.truth, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
    return image, truth


def write(path: Path, frames: list[Frame], size: tuple[int, int], count: int | None = None) -> Path:
    """Write a log of these frames at a size, again and again until there are ``count``."""
    pictures = [(jpeg_of(image), truth) for image, truth in (resized(f, *size) for f in frames)]
    with LogWriter(path) as log:
        for stamp, (jpeg, truth) in _stamped(pictures, count):
            log.image("/camera", stamp, jpeg, "jpeg")
            log.mask("/road_mask", stamp, truth)
    return path


def write_form(path: Path, frames: list[Frame], size: tuple[int, int], form: str) -> Path:
    """Write a log of images alone, in one of `FORMS`."""
    images = [resized(frame, *size)[0] for frame in frames]
    container, encoding = form.split()
    if container == "protobuf":
        with LogWriter(path) as log:
            for stamp, image in _stamped(images):
                if encoding == "jpeg":
                    log.image("/camera", stamp, jpeg_of(image), "jpeg")
                else:
                    log.mask("/camera", stamp, image)
    else:
        _write_ros2(path, images, encoding)
    return path


def _write_ros2(path: Path, images: list[np.ndarray], encoding: str) -> None:
    raw = encoding == "raw"
    with path.open("wb") as file:
        writer = Writer(file)
        name, text = ("Image", _RAW) if raw else ("CompressedImage", COMPRESSED)
        schema = writer.register_msgdef(f"sensor_msgs/msg/{name}", text)
        for stamp, image in _stamped(images):
            message = _ros2_raw(image) if raw else {"format": "jpeg", "data": jpeg_of(image)}
            seconds, rest = divmod(stamp, 1_000_000_000)
            header = {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": "camera"}
            writer.write_message("/camera", schema, {"header": header, **message}, stamp, stamp)
        writer.finish()


def _ros2_raw(image: np.ndarray) -> dict[str, Any]:
    height, width, _ = image.shape
    return {
        "height": height,
        "width": width,
        "encoding": "rgb8",
        "is_bigendian": 0,
        "step": 3 * width,
        "data": image.tobytes(),
    }


def _stamped(pictures: list[Any], count: int | None = None) -> Iterator[tuple[int, Any]]:
    many = islice(cycle(pictures), count or len(pictures))
    return ((PERIOD_NS * number, picture) for number, picture in enumerate(many, 1))


def jpeg_of(image: np.ndarray) -> bytes:
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes()
