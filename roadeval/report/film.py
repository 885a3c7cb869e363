"""A drive as a small video for a page: the camera, the truth and the masks of each frame.

Every picture of the video holds all panels of one frame beside each other, so one seek shows a
frame of all of them. Truth, masks and probabilities are shades of grey; the page paints errors and
masks over the camera, so any variant can be looked at, and any threshold. VP9 in WebM plays in
every present browser; Debian's Chromium has no decoder for H.264.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from roadeval.data import IGNORE
from roadeval.data.arrays import Plane

CAMERA: Final = "camera"
TRUTH_PANEL: Final = "truth"
MASK: Final = "{}: mask"
PROBABILITY: Final = "{}: probability"
"""Names of the panels."""
FPS: Final = 10
NO_MASK: Final = 128
"""The shade of ignored pixels, and of a mask that a frame does not have."""
_WIDTHS: Final = {4: 480, 9: 400}
_NARROW: Final = 320
"""Most pixels across a panel, by the number of panels, and of more panels."""
_KEYFRAMES: Final = 10
"""Frames from one keyframe to the next: a seek decodes at most so many."""


@dataclass(frozen=True, eq=False)
class Film:
    """The video of a drive."""

    content: bytes
    """WebM with VP9."""
    frames: Sequence[int]
    """The number of the frame that each picture shows."""
    panels: Sequence[str]
    """Names of the panels, row by row."""
    columns: int
    """Panels beside each other."""
    width: int
    height: int
    """Size of a panel in pixels."""

    def as_json(self) -> dict[str, Any]:
        """Return all but the video itself."""
        names = ("frames", "panels", "columns", "width", "height")
        return {name: getattr(self, name) for name in names} | {"fps": FPS}


def shade_truth(truth: Plane) -> Plane:
    """Return a truth in shades: non-road black, road white, ignored pixels between."""
    return np.where(truth == IGNORE, NO_MASK, np.where(truth, 255, 0)).astype(np.uint8)


def make_film(
    frames: Sequence[int],
    panels: Sequence[str],
    read: Callable[[int], Mapping[str, Plane]],
    room: int,
) -> Film:
    """Return the video of frames, of at most about ``room`` bytes.

    ``read`` returns the panels of a frame by their names: ``(H, W, 3)`` uint8 RGB, or ``(H, W)``
    uint8 shades; a panel that it leaves out is grey. All frames have the size of the first one.
    """
    first = read(frames[0])[CAMERA]
    most = next((width for count, width in _WIDTHS.items() if len(panels) <= count), _NARROW)
    width = max(min(first.shape[1], most) // 2 * 2, 2)
    height = max(round(first.shape[0] * width / first.shape[1] / 2) * 2, 2)
    columns = math.ceil(math.sqrt(len(panels)))

    def mosaic(frame: int) -> Plane:
        """Return the panels of a frame in one picture, ``(rows H, columns W, 3)`` uint8 RGB."""
        by_name = read(frame)
        rows = -(-len(panels) // columns)
        picture = np.full((rows * height, columns * width, 3), NO_MASK, np.uint8)
        for place, name in enumerate(panels):
            if (panel := by_name.get(name)) is not None:
                top, left = place // columns * height, place % columns * width
                picture[top : top + height, left : left + width] = _fit(panel, width, height)
        return picture

    content = _encode(map(mosaic, frames), len(frames), room)
    return Film(content, frames, panels, columns, width, height)


def _fit(panel: Plane, width: int, height: int) -> Plane:
    """Return a panel in its size; shades have a third axis of one, and none are mixed.

    The mean of road and non-road would be the shade of ignored pixels.
    """
    import cv2

    method = cv2.INTER_AREA if panel.ndim == 3 else cv2.INTER_NEAREST
    fitted = cv2.resize(panel, (width, height), interpolation=method)
    return np.asarray(fitted.reshape(height, width, -1), np.uint8)


def _encode(pictures: Iterable[Plane], count: int, room: int) -> bytes:
    """Encode pictures as VP9 of one quality, and of less quality if they would not have room."""
    import av

    file = io.BytesIO()
    # One thread: two of them may divide the work otherwise, and equal drives give equal pages.
    options = {"crf": "36", "deadline": "realtime", "cpu-used": "8", "row-mt": "0"}
    with av.open(file, "w", format="webm") as container:
        stream = None
        for picture in pictures:
            if stream is None:
                stream = container.add_stream("libvpx-vp9", rate=FPS, options=options)
                stream.height, stream.width = picture.shape[:2]
                stream.pix_fmt, stream.thread_count = "yuv420p", 1
                stream.gop_size = _KEYFRAMES
                stream.bit_rate = int(8 * room * FPS / count)
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            container.mux(stream.encode(frame))
        if stream is not None:
            container.mux(stream.encode())
    return file.getvalue()
