"""What is known of a camera beside its pictures: its lens, and where it is mounted."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Mounting:
    """Where a camera is, as seen from the frame at the root of the log's transforms."""

    parent: str
    """That frame's name, as ``base_link``."""
    translation: tuple[float, ...]
    """Of the camera in it: x, y, z in metres."""
    rotation: tuple[float, ...]
    """From the camera's axes to its axes, as a quaternion x, y, z, w."""


@dataclass(frozen=True)
class Calibration:
    """A camera's intrinsics, as the log has them."""

    topic: str
    width: int
    height: int
    """Of the image that they are for, in pixels."""
    matrix: tuple[float, ...]
    """The nine numbers of K, row by row: focal lengths and principal point in pixels."""
    model: str = ""
    """The distortion's, as ``plumb_bob``; empty where none is named."""
    distortion: tuple[float, ...] = ()
    frame_id: str = ""
    """The camera's name in the log's transforms."""
    mounting: Mounting | None = None
    """None where no static transform tells it."""

    def scaled(self, width: int, height: int) -> Calibration:
        """Return the calibration of the same image in another size, in pixels."""
        across, down = width / self.width, height / self.height
        k = self.matrix
        # The centre of the first pixel is at (0, 0), so that its corner is at half a pixel less.
        right, below = ((c + 0.5) * s - 0.5 for c, s in ((k[2], across), (k[5], down)))
        matrix = (k[0] * across, k[1] * across, right, k[3] * down, k[4] * down, below, *k[6:])
        return replace(self, width=width, height=height, matrix=matrix)
