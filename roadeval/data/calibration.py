"""The calibration of a camera: its lens and its mounting."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from roadeval.runtime.sentence import Sentence

FISHEYE: Final = ("equidistant", "fisheye", "kannala_brandt")
"""Models with a distance from the centre that grows with the angle of a ray, not with its slope."""


@dataclass(frozen=True)
class Mounting:
    """The place of a camera in the frame at the root of the log's transforms."""

    parent: str
    """The root frame's name, such as ``base_link``."""
    translation: tuple[float, ...]
    """The camera's place in the root frame: x, y, z in metres."""
    rotation: tuple[float, ...]
    """The rotation from the camera's axes to the root frame's, as a quaternion x, y, z, w."""

    @property
    def has_body_axes(self) -> bool:
        """Whether the camera's z axis points up, as a vehicle's does, and not ahead."""
        x, y, z, w = self.rotation
        return 1 - 2 * (x * x + y * y) > 0.5 > abs(2 * (y * z + x * w))


@dataclass(frozen=True)
class Calibration:
    """A camera's intrinsics, as the log has them."""

    topic: str
    width: int
    height: int
    """Size in pixels of the calibrated images."""
    matrix: tuple[float, ...]
    """The nine numbers of K, row by row: focal lengths and principal point in pixels."""
    model: str = ""
    """The model of the distortion, such as ``plumb_bob``; empty if it has no name."""
    distortion: tuple[float, ...] = ()
    frame_id: str = ""
    """The camera's name in the log's transforms."""
    mounting: Mounting | None = None
    """None if no static transform shows it."""

    @property
    def problem(self) -> str:
        """The first impossible property, as "focal length is 0"; empty if there is none."""
        fx, skew, x, zero, fy, y, *last = (*self.matrix, *(math.nan,) * 9)[:9]
        short, long = sorted((self.width, self.height))
        pixels = f"{self.width}x{self.height} pixels"
        aside = abs(x - self.width / 2), abs(y - self.height / 2)
        possible = {
            f"size is {pixels}": 1 <= short <= long <= 65_536,
            "focal length is 0: the camera was never calibrated": fx or fy,
            f"focal length is {fx:.6g} and {fy:.6g} for {pixels}": (
                0.02 * short <= min(fx, fy) <= max(fx, fy) <= min(200 * long, 5 * fx, 5 * fy)
            ),
            "focal length is not clear: its matrix is not fx 0 cx, 0 fy cy, 0 0 1": (
                abs(skew) <= fx and (zero, *last) == (0, 0, 0, 1)
            ),
            f"centre is {x:.6g}, {y:.6g} in {pixels}": all(n <= 10 * long for n in aside),
            "distortion has a number that is not finite, or beyond a million": all(
                abs(number) <= 1e6 for number in self.distortion
            ),
        }
        return next((text for text, holds in possible.items() if not holds), "")

    @property
    def doubt(self) -> str:
        """The reason to doubt the matrix, a centre far from the middle; empty without doubt."""
        x, y = self.matrix[2], self.matrix[5]
        if all(1 / 3 < at / side < 3 / 4 for at, side in ((x, self.width), (y, self.height))):
            return ""
        middle = f"the middle of {self.width}x{self.height} pixels"
        far = "its centre, {}, {}, is far from {}: correct it with {ground}"
        return Sentence(far, f"{x:.4g}", f"{y:.4g}", middle)

    @property
    def bends(self) -> bool:
        """Whether it bends straight lines; a fisheye does even without coefficients."""
        return any(self.distortion) or self.model.lower() in FISHEYE

    def has_shape(self, width: int, height: int) -> bool:
        """Return whether images of this size have the same shape, to within a pixel."""
        off = abs(self.width * height - self.height * width)
        return off <= max(self.width + self.height, width + height)

    def part(
        self, corner: tuple[int, int], size: tuple[int, int], bins: Sequence[int]
    ) -> Calibration:
        """Return the calibration of a part of the sensor with binned pixels.

        As in ROS, the corner is subtracted before the division by ``bins``. A centre in the exact
        middle stays there.
        """
        k, (across, down) = self.matrix, bins
        sides = (self.width, self.height)
        halves = [0.5 * (2 * at == side - 1) for at, side in zip(k[2:6:3], sides, strict=True)]
        x, y = (
            (at - begin + half) / pixels - half
            for at, begin, pixels, half in zip(k[2:6:3], corner, bins, halves, strict=True)
        )
        matrix = (k[0] / across, k[1] / across, x, k[3], k[4] / down, y, *k[6:])
        return replace(self, width=size[0], height=size[1], matrix=matrix)

    def scaled(self, width: int, height: int) -> Calibration:
        """Return the calibration of the same image in another size."""
        across, down = width / self.width, height / self.height
        k = self.matrix
        # The centre of the first pixel is at (0, 0), and its corner at (-0.5, -0.5).
        right, below = ((c + 0.5) * s - 0.5 for c, s in ((k[2], across), (k[5], down)))
        matrix = (k[0] * across, k[1] * across, right, k[3] * down, k[4] * down, below, *k[6:])
        return replace(self, width=width, height=height, matrix=matrix)
