"""What is known of a camera beside its pictures: its lens, and where it is mounted."""

from __future__ import annotations

import math
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

    @property
    def problem(self) -> str:
        """What no camera can have, as "focal length is 0": the setting first; empty if nothing."""
        k = self.matrix if len(self.matrix) == 9 else (math.nan,) * 9
        across, down, less, more = k[0], k[4], min(k[0], k[4]), max(k[0], k[4])
        short, long = sorted((self.width, self.height))
        pixels = f"{self.width}x{self.height} pixels"
        aside = abs(k[2] - self.width / 2), abs(k[5] - self.height / 2)
        checks = {
            f"size is {pixels}": 1 <= short <= long <= 65_536,
            "focal length is not known: its matrix is not nine numbers": len(self.matrix) == 9,
            "focal length is 0: the camera was never calibrated": across or down,
            f"focal length is {across:.6g} and {down:.6g} for {pixels}": (
                0.02 * short <= less <= more <= min(200 * long, 5 * less)
            ),
            "focal length is not clear: its matrix is not fx 0 cx, 0 fy cy, 0 0 1": (
                abs(k[1]) <= across and (k[3], *k[6:]) == (0, 0, 0, 1)
            ),
            f"centre is {k[2]:.6g}, {k[5]:.6g} in {pixels}": all(
                length <= 10 * long for length in aside
            ),
            "distortion has a number that is not finite, or beyond a million": all(
                abs(number) <= 1e6 for number in self.distortion
            ),
        }
        return next((text for text, holds in checks.items() if not holds), "")

    def scaled(self, width: int, height: int) -> Calibration:
        """Return the calibration of the same image in another size, in pixels."""
        across, down = width / self.width, height / self.height
        k = self.matrix
        # The centre of the first pixel is at (0, 0), so that its corner is at half a pixel less.
        right, below = ((c + 0.5) * s - 0.5 for c, s in ((k[2], across), (k[5], down)))
        matrix = (k[0] * across, k[1] * across, right, k[3] * down, k[4] * down, below, *k[6:])
        return replace(self, width=width, height=height, matrix=matrix)
