"""The measured drives: frames of a log, resized.

Sizes are made by resizing, so that every size shows the same scenes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import cycle, islice
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from roadeval.config.run import configure
from roadeval.data import Frame
from roadeval.logs.log import open_log
from roadeval.logs.writing.writer import LogWriter

PERIOD_NS: Final = 100_000_000
JPEG_QUALITY: Final = 90

HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
NESTED = (
    f"\n{'=' * 80}\nMSG: std_msgs/Header\n{HEADER}"
    f"\n{'=' * 80}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
COMPRESSED = f"std_msgs/Header header\nstring format\nuint8[] data\n{NESTED}"


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
            return [frame.decode() for frame in islice(readable, count)]


def resized(frame: Frame, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Bring an image and its truth to a size: ``(H, W, 3)`` RGB and ``(H, W)``."""
    image = cv2.resize(frame.image, (width, height), interpolation=cv2.INTER_LINEAR)
    truth = cv2.resize(frame.truth, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
    return image, truth


def write(path: Path, frames: list[Frame], size: tuple[int, int], count: int | None = None) -> Path:
    """Write a log of these frames at a size, again and again until there are ``count``."""
    pictures = [(jpeg_of(image), truth) for image, truth in (resized(f, *size) for f in frames)]
    with LogWriter(path) as log:
        many = islice(cycle(pictures), count or len(pictures))
        for number, (jpeg, truth) in enumerate(many, 1):
            stamp = PERIOD_NS * number
            log.image("/camera", stamp, jpeg, "jpeg")
            log.mask("/road_mask", stamp, truth)
    return path


def jpeg_of(image: np.ndarray) -> bytes:
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes()
