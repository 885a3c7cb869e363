"""Frames as videos: the film of a drive for a page, and clips of errors.

Each picture of the film holds all panels of one frame beside each other: the camera, the truth and
the masks, so one seek shows them all. Truth, masks and probabilities are shades of grey; the page
paints errors and masks over the camera, for any variant and any threshold. VP9 in WebM plays in
every current browser. A clip, for players and chats, is H.264 in MP4, or a GIF.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final

import numpy as np

from roadeval.data import ERRORS, IGNORE, NON_ROAD, ROAD, Rgb, Truth
from roadeval.data.arrays import Plane
from roadeval.data.colours import FN, FP, GREY, TP
from roadeval.report.captions import caption
from roadeval.report.images import LayerImage, paint

CAMERA: Final = "camera"
TRUTH_PANEL: Final = "truth"
MASK: Final = "{}: mask"
PROBABILITY: Final = "{}: probability"
"""Names of the panels."""
FPS: Final = 10
NO_MASK: Final = 128
"""The shade of ignored pixels, and of a mask that a frame does not have."""
_WIDTHS: Final = {4: 480, 9: 400, math.inf: 320}
"""Greatest width of a panel in pixels, by the number of panels."""
_KEYFRAMES: Final = 10
"""Frames from one keyframe to the next: the most frames that a seek decodes."""
_CODECS: Final = {"webm": "libvpx-vp9", "mp4": "libx264", "gif": "gif"}
_NAMED: Final = {"green": TP, "orange-red": FP, "pink": FN, "grey": GREY}
"""The codec of each container, and the colours that captions name."""


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
    """Number of panels in a row."""
    width: int
    height: int
    """Size of a panel in pixels."""

    def as_json(self) -> dict[str, Any]:
        """Return all but the video itself."""
        names = ("frames", "panels", "columns", "width", "height")
        return {name: getattr(self, name) for name in names} | {"fps": FPS}


def shade_truth(truth: Plane) -> Plane:
    """Return a truth as ``(H, W)`` uint8 shades: 0 non-road, 255 road, `NO_MASK` ignored."""
    return np.where(truth == IGNORE, NO_MASK, np.where(truth, 255, 0)).astype(np.uint8)


def make_film(
    frames: Sequence[int],
    panels: Sequence[str],
    read: Callable[[int], Mapping[str, Plane]],
    room: int,
) -> Film:
    """Return the video of frames, of at most about ``room`` bytes.

    ``read`` returns the panels of a frame by their names: ``(H, W, 3)`` uint8 RGB, or ``(H, W)``
    uint8 shades; a missing panel is grey. All frames have the size of the first one.
    """
    first = read(frames[0])[CAMERA]
    most = next(width for count, width in _WIDTHS.items() if len(panels) <= count)
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

    # The quality is the same for every film, and lower if the film would exceed its room.
    options = {"crf": "36", "deadline": "realtime", "cpu-used": "8", "row-mt": "0"}
    options["b"] = str(int(8 * room * FPS / len(frames)))
    content = encode(map(mosaic, frames), "webm", Fraction(FPS), options)
    return Film(content, frames, panels, columns, width, height)


def _fit(panel: Plane, width: int, height: int) -> Plane:
    """Return a panel as ``(height, width, 3)`` uint8 RGB, or ``(height, width, 1)`` uint8 shades.

    Shades are not mixed: the mean of road and non-road would be the shade of ignored pixels.
    """
    import cv2

    method = cv2.INTER_AREA if panel.ndim == 3 else cv2.INTER_NEAREST
    fitted = cv2.resize(panel, (width, height), interpolation=method)
    return np.asarray(fitted.reshape(height, width, -1), np.uint8)


def encode(pictures: Iterable[Plane], form: str, rate: Fraction, options: dict[str, str]) -> bytes:
    """Return ``(H, W, 3)`` uint8 RGB pictures with even sides as a video, ``rate`` a second."""
    import av

    file = io.BytesIO()
    # With this flag and one thread, equal pictures give equal bytes.
    with av.open(file, "w", format=form, options={"fflags": "+bitexact"}) as container:
        stream = None
        for picture in pictures:
            if stream is None:
                stream = container.add_stream(_CODECS[form], rate=rate, options=options)
                stream.height, stream.width = picture.shape[:2]
                stream.pix_fmt = "rgb8" if form == "gif" else "yuv420p"
                stream.thread_count, stream.gop_size = 1, _KEYFRAMES
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            container.mux(stream.encode(frame))
        if stream is not None:
            container.mux(stream.encode())
    return file.getvalue()


def clip_picture(panels: Sequence[LayerImage], truth: Truth | None, about: str) -> Rgb:
    """Return titled panels, 960 to 1920 pixels across, above a line on colours and the drive.

    Panels that would be higher than 4096 pixels are smaller: an encoder has a greatest size.
    """
    import cv2

    painted = np.hstack([paint(panel) for panel in panels])
    words = caption("errors" if panels[0].spec is ERRORS else "thumbnails without truth")
    texts = [*words.rstrip(".").split("; "), about]
    if truth is not None:
        near_road = cv2.dilate((truth == ROAD).view(np.uint8), np.ones((3, 3), np.uint8))
        painted[np.tile((near_road > 0) & (truth == NON_ROAD), len(panels))] = 255
        texts.insert(-1, "white: the true road's edge")
    height, width = painted.shape[:2]
    across = min(width * -(-960 // width), 1920, max(4096 * width // height, 64)) // 2 * 2
    titles = np.hstack([_line([panel.title], across // len(panels)) for panel in panels])
    enlarged = _fit(painted, across, round(height * across / width / 2) * 2)
    return np.vstack([titles, enlarged, _line(texts, across)])


def _line(texts: Sequence[str], width: int) -> Rgb:
    """Return ``(24, width, 3)`` uint8 RGB: texts on black, in the colours that they name."""
    import cv2

    font, gap, left = cv2.FONT_HERSHEY_SIMPLEX, 14, 7.0
    sizes = [cv2.getTextSize(text, font, 0.5, 1)[0][0] + gap for text in texts]
    small = min(1.0, (width - gap) / sum(sizes))
    line = np.zeros((24, width, 3), np.uint8)
    for text, size in zip(texts, sizes, strict=True):
        colour = _NAMED.get(text.partition(":")[0].lower(), (255, 255, 255))
        cv2.putText(line, text, (round(left), 17), font, 0.5 * small, colour, 1, cv2.LINE_AA)
        left += size * small
    return line
