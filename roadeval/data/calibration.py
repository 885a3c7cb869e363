"""What is known of a camera beside its pictures: its lens, and where it is mounted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

FISHEYE: Final = ("equidistant", "fisheye", "kannala_brandt")
"""Models whose rays' angles, not their slopes, grow with the distance from the centre."""


@dataclass(frozen=True)
class Mounting:
    """Where a camera is, as seen from the frame at the root of the log's transforms."""

    parent: str
    """That frame's name, as ``base_link``."""
    translation: tuple[float, ...]
    """Of the camera in it: x, y, z in metres."""
    rotation: tuple[float, ...]
    """From the camera's axes to its axes, as a quaternion x, y, z, w."""

    @property
    def has_body_axes(self) -> bool:
        """Whether the camera's z points up, as a vehicle's, where a camera's points ahead."""
        x, y, z, w = self.rotation
        return 1 - 2 * (x * x + y * y) > 0.5 > abs(2 * (y * z + x * w))


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

    @property
    def doubt(self) -> str:
        """What tells that its matrix is of images of another size: a centre far from theirs."""
        x, y = self.matrix[2], self.matrix[5]
        if all(1 / 3 < at / side < 3 / 4 for at, side in ((x, self.width), (y, self.height))):
            return ""
        pixels = f"{self.width}x{self.height} pixels"
        return f"its centre, {x:.4g}, {y:.4g}, is far from the middle of {pixels}: is it of others?"

    @property
    def bends(self) -> bool:
        """Whether straight lines are bent in its images: a fisheye's are without coefficients."""
        return any(self.distortion) or self.model.lower() in FISHEYE

    def has_shape(self, width: int, height: int) -> bool:
        """Return whether images of this size have the shape of its own, but for a pixel."""
        off = abs(self.width * height - self.height * width)
        return off <= max(self.width + self.height, width + height)

    def part(
        self, corner: tuple[int, int], size: tuple[int, int], bins: Sequence[int]
    ) -> Calibration:
        """Return the calibration of a part of the sensor whose pixels are binned.

        ``corner`` is its first pixel, ``size`` what is left, ``bins`` how many pixels, across and
        down, become one. As ROS does, the corner comes off first, and then all is divided; a centre
        in the very middle of the pixels' centres stays there.
        """
        k, centre = self.matrix, []
        for at, begin, pixels, length in zip(
            (k[2], k[5]), corner, bins, (self.width, self.height), strict=True
        ):
            half = 0.5 * (at == (length - 1) / 2)
            centre.append((at - begin + half) / pixels - half)
        across, down = bins
        matrix = (k[0] / across, k[1] / across, centre[0], k[3], k[4] / down, centre[1], *k[6:])
        return replace(self, width=size[0], height=size[1], matrix=matrix)

    def scaled(self, width: int, height: int) -> Calibration:
        """Return the calibration of the same image in another size, in pixels."""
        across, down = width / self.width, height / self.height
        k = self.matrix
        # The centre of the first pixel is at (0, 0), so that its corner is at half a pixel less.
        right, below = ((c + 0.5) * s - 0.5 for c, s in ((k[2], across), (k[5], down)))
        matrix = (k[0] * across, k[1] * across, right, k[3] * down, k[4] * down, below, *k[6:])
        return replace(self, width=width, height=height, matrix=matrix)
