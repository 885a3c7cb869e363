"""Flat, partly transparent, textured rectangles in the world: everything that is not ground.

A wall is a panel, and so is a tree: its view from the road, painted once. A panel keeps the light
of the sun and the light of the sky that it returns apart, so that a cloud changes its look without
painting it anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from benchmarks.world.camera import NEAR, Camera
from benchmarks.world.light import Light
from benchmarks.world.noise import Field
from roadeval.data.arrays import Floats

HAZE_LENGTH: Final = 2600.0
"""Distance at which the air has replaced all but 1/e of the light behind it, metres."""

Window = tuple[int, int, int, int]
"""Columns and rows of an image: left, top, right, bottom, the last two excluded."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """The picture of a panel, at full and at halved resolutions.

    Parameters
    ----------
    sun
        ``(h, w, 4)`` float32: RGB returned per unit of direct sun; opacity 0..1.
    sky
        ``(h, w, 4)`` float32: RGB returned per unit of skylight; share of the sun's disc that
        the surface sees. All of it multiplied by the opacity.
    """

    sun: tuple[Field, ...]
    sky: tuple[Field, ...]

    @classmethod
    def of(cls, sun: Field, sky: Field) -> Picture:
        """Halve both images as long as they have 8 pixels each way."""
        return cls(_halved(sun), _halved(sky))

    @classmethod
    def painted(
        cls, image: Field, direct: Field | float, sky: Field | float, visible: Field | float
    ) -> Picture:
        """Make the picture of a surface from its reflectance and the light on it.

        Parameters
        ----------
        image
            ``(h, w, 4)`` RGB reflectance and opacity, 0..1.
        direct, sky, visible
            ``(h, w)`` or one number: sun falling on the surface (cosine times visible share),
            share of level ground's skylight that it gets, share of the sun's disc that it sees.
        """
        colour, opacity = image[..., :3], image[..., 3]
        lit, shaded, seen = (
            np.asarray(light * opacity, np.float32)[..., None] for light in (direct, sky, visible)
        )
        return cls.of(np.dstack([colour * lit, opacity]), np.dstack([colour * shaded, seen]))


def _halved(image: Field) -> tuple[Field, ...]:
    images = [image]
    while min(images[-1].shape[:2]) >= 16:
        rows, columns = images[-1].shape[:2]
        size = (columns // 2, rows // 2)
        images.append(cv2.resize(images[-1], size, interpolation=cv2.INTER_AREA))
    return tuple(images)


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """A picture hung in the world.

    Parameters
    ----------
    picture
        What it looks like.
    corner
        ``(3,)`` metres: the picture's top left corner.
    right, down
        ``(3,)`` metres: from that corner to the top right and to the bottom left one.
    sunlit
        Share of the sun's disc that other things leave to the whole panel.
    """

    picture: Picture
    corner: Floats
    right: Floats
    down: Floats
    sunlit: float = 1.0

    def corners(self) -> Floats:
        """``(4, 3)`` metres, around the panel."""
        beside, below = self.corner + self.right, self.corner + self.down
        return np.array([self.corner, beside, beside + self.down, below])

    @property
    def farthest(self) -> float:
        """Z of the corner farthest down the road, metres: panels are painted in its order."""
        return float(self.corner[2] + max(0.0, self.right[2]) + max(0.0, self.down[2]))


@dataclass(frozen=True, slots=True, eq=False)
class Film:
    """The image before the sensor; panels are painted over it, far ones first.

    Parameters
    ----------
    radiance
        ``(H, W, 3)`` float32.
    visible
        ``(H, W)`` float32: share of the sun's disc that the pixel's surface sees; 1 for the sky.
    road
        ``(H, W)`` float32: share of the pixel that is road.
    """

    radiance: Field
    visible: Field
    road: Field


def draw(film: Film, camera: Camera, panel: Panel, light: Light, haze: Field) -> None:
    """Paint a panel over the film.

    ``haze`` is the ``(3,)`` radiance of the air in front of it, by depth of its nearest corner.
    """
    corners = panel.corners()
    outline = camera.outline(corners)
    window = _window(outline, camera)
    if window is None:
        return
    nearest = max(NEAR, float(camera.depth(corners).min()))
    sun, sky = _warped(panel, camera, nearest, window)
    if nearest <= NEAR:
        inside = _inside(outline, window)
        sun, sky = sun * inside, sky * inside
    clear = np.float32(np.exp(-nearest / HAZE_LENGTH))
    direct = clear * np.float32(panel.sunlit) * light.direct
    opacity = sun[..., 3]
    radiance = sun[..., :3] * direct + sky[..., :3] * (clear * light.sky)
    radiance += ((1 - clear) * opacity)[..., None] * haze
    through = 1.0 - opacity
    left, top, right, bottom = window
    here = np.s_[top:bottom, left:right]
    film.radiance[here] = film.radiance[here] * through[..., None] + radiance
    film.visible[here] = film.visible[here] * through + sky[..., 3] * np.float32(panel.sunlit)
    film.road[here] *= through


def _warped(panel: Panel, camera: Camera, depth: float, window: Window) -> tuple[Field, Field]:
    """Both images of the panel's picture as they appear in a window of the camera's image."""
    left, top, right, bottom = window
    level = _level(panel, camera, depth)
    place = _homography(panel, camera, panel.picture.sun[level].shape, left, top)
    size = (right - left, bottom - top)
    sun = cv2.warpPerspective(panel.picture.sun[level], place, size)
    return sun, cv2.warpPerspective(panel.picture.sky[level], place, size)


def _inside(outline: Floats, window: Window) -> Field:
    """``(h, w, 1)``: 1 inside of an outline; otherwise parts behind the camera would appear too."""
    left, top, right, bottom = window
    inside = np.zeros((bottom - top, right - left, 1), np.float32)
    cv2.fillConvexPoly(inside, np.round(outline - (left, top)).astype(np.int32), 1.0)
    return inside


def _window(outline: Floats, camera: Camera) -> Window | None:
    """Return the part of the image that an outline touches; None if it misses."""
    if not len(outline):
        return None
    left, top = np.maximum(np.floor(outline.min(0)) - 1, 0).astype(int).tolist()
    ends = np.ceil(outline.max(0)) + 2
    right, bottom = np.minimum(ends, (camera.width, camera.height)).astype(int).tolist()
    return (left, top, right, bottom) if left < right and top < bottom else None


def _level(panel: Panel, camera: Camera, depth: float) -> int:
    """Choose the resolution that has about one pixel of the picture to one of the image."""
    rows = panel.picture.sun[0].shape[0]
    shown = float(np.linalg.norm(panel.down)) * camera.focal / depth
    return int(np.clip(np.round(np.log2(rows / shown)), 0, len(panel.picture.sun) - 1))


def _homography(
    panel: Panel, camera: Camera, shape: tuple[int, ...], left: int, top: int
) -> Floats:
    """``(3, 3)``: from the picture's pixels to the image's, counted from ``left`` and ``top``."""
    right, down = panel.right / shape[1], panel.down / shape[0]
    first = panel.corner + (right + down) / 2 - camera.position
    window = np.array([[1.0, 0.0, -left], [0.0, 1.0, -top], [0.0, 0.0, 1.0]])
    return np.asarray(window @ camera.projection @ np.stack([right, down, first], axis=1))
