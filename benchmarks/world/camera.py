"""The camera as geometry: where it stands, which ray each pixel sees, where a point lands."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from benchmarks.world.noise import Field
from roadeval.data.arrays import Flags, Floats

FOCAL_OVER_WIDTH: Final = 0.875
"""Focal length in image widths: a horizontal field of view of 59 degrees."""
NEAR: Final = 0.4
"""Nothing nearer than this is drawn, metres."""
LEAST: Final = 1.5
"""Nothing lower than this in the image is drawn, pixels."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Place of the camera (metres) and its direction (radians).

    Positive yaw looks right, positive pitch up, positive roll leans right.
    """

    x: float
    y: float
    z: float
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0

    def axes(self) -> Floats:
        """``(3, 3)``: the image's right, down and forward directions in the world, as rows."""
        sin_y, cos_y = np.sin(self.yaw), np.cos(self.yaw)
        sin_p, cos_p = np.sin(self.pitch), np.cos(self.pitch)
        sin_r, cos_r = np.sin(self.roll), np.cos(self.roll)
        level = np.array([cos_y, 0.0, -sin_y])
        down = np.array([sin_p * sin_y, -cos_p, sin_p * cos_y])
        forward = np.array([cos_p * sin_y, sin_p, cos_p * cos_y])
        return np.stack([cos_r * level + sin_r * down, cos_r * down - sin_r * level, forward])


@dataclass(frozen=True)
class Camera:
    """A pinhole camera of ``width`` x ``height`` pixels in a pose."""

    width: int
    height: int
    pose: Pose

    @property
    def focal(self) -> float:
        """Focal length in pixels."""
        return FOCAL_OVER_WIDTH * self.width

    @cached_property
    def axes(self) -> Floats:
        """``(3, 3)``: the image's right, down and forward directions in the world, as rows."""
        return self.pose.axes()

    @cached_property
    def position(self) -> Floats:
        """``(3,)`` metres."""
        return np.array([self.pose.x, self.pose.y, self.pose.z])

    @cached_property
    def projection(self) -> Floats:
        """``(3, 3)``: from a world direction to homogeneous (column, row) of its pixel."""
        centre_x, centre_y = (self.width - 1) / 2, (self.height - 1) / 2
        intrinsics = np.array(
            [[self.focal, 0.0, centre_x], [0.0, self.focal, centre_y], [0.0, 0.0, 1.0]]
        )
        return np.asarray(intrinsics @ self.axes)

    def rays(self) -> Field:
        """``(H, W, 3)`` float32 world directions; a point is position plus depth times ray."""
        columns = np.arange(self.width, dtype=np.float32) - np.float32((self.width - 1) / 2)
        rows = np.arange(self.height, dtype=np.float32) - np.float32((self.height - 1) / 2)
        right, down, forward = self.axes.astype(np.float32)
        across = (columns / np.float32(self.focal))[:, None] * right + forward
        along = (rows / np.float32(self.focal))[:, None] * down
        return np.asarray(across[None, :, :] + along[:, None, :])

    def project(self, points: Floats) -> Floats:
        """Project ``(n, 3)`` world points in front of the camera to ``(n, 2)`` column and row."""
        image = (points - self.position) @ self.projection.T
        return np.asarray(image[:, :2] / image[:, 2:])

    def depth(self, points: Floats) -> Floats:
        """``(n,)`` distance of ``(n, 3)`` world points along the optical axis, metres."""
        return np.asarray((points - self.position) @ self.axes[2])

    def catches(self, corners: Floats) -> Flags:
        """Return which of ``(n, 4, 3)`` rectangles may be seen: ``(n,)`` bool, a quick guess.

        Points behind it, to either side, or too low in the image are left out.
        """
        right, _, forward = self.axes
        depth = (corners - self.position) @ forward
        before = np.maximum(depth, NEAR)
        column = (corners - self.position) @ right / before * self.focal
        beside = (column.max(1) < -self.width / 2) | (column.min(1) > self.width / 2)
        height = np.ptp(corners[..., 1], axis=1) / before.min(1) * self.focal
        return np.asarray((depth.max(1) > NEAR) & ~beside & (height >= LEAST))

    def outline(self, corners: Floats) -> Floats:
        """Project the part of a polygon, ``(n, 3)``, that is not behind: ``(m, 2)``, m maybe 0."""
        depth = self.depth(corners)
        if depth.min() >= NEAR:
            return self.project(corners)
        corners: list[Floats] = []
        for here, there, d0, d1 in zip(
            corners, np.roll(corners, -1, 0), depth, np.roll(depth, -1), strict=True
        ):
            if d0 >= NEAR:
                corners.append(here)
            if (d0 >= NEAR) != (d1 >= NEAR):
                corners.append(here + (there - here) * (NEAR - d0) / (d1 - d0))
        return self.project(np.array(corners)) if corners else np.empty((0, 2))
