"""The frames of a video file."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Final

from roadeval.logs.errors import LogError
from roadeval.logs.times import NS

VIDEO_SUFFIXES: Final = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".ts", ".mpg", ".mpeg")
QUALITY: Final = 95
"""JPEG quality of the frames, 0 to 100."""


def frames_of(video: Path) -> Iterator[tuple[int, bytes]]:
    """Yield each frame's time in nanoseconds after the first, and the frame as a JPEG.

    Raises
    ------
    LogError
        If it cannot be read, or holds no video.
    """
    import av
    import cv2

    try:
        with av.open(str(video)) as container:
            if not container.streams.video:
                raise LogError(f"{video}: it holds no video")
            stream = container.streams.video[0]
            first: int | None = None
            for index, frame in enumerate(container.decode(stream)):
                pts = index if frame.pts is None else frame.pts
                first = pts if first is None else first
                unit = stream.time_base or Fraction(1, 25)
                bgr = frame.to_ndarray(format="bgr24")
                _, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
                yield round((pts - first) * unit * NS), jpeg.tobytes()
    except (av.FFmpegError, OSError) as error:
        raise LogError(f"{video}: not a readable video ({error.strerror})") from error
