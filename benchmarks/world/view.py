"""One view of the scene: from a pose and the light of a moment to the image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from benchmarks.world.camera import Camera
from benchmarks.world.cars import Car
from benchmarks.world.light import Light
from benchmarks.world.noise import Field
from benchmarks.world.panel import HAZE_LENGTH, Film, draw
from benchmarks.world.scene import Scene
from benchmarks.world.sky import air
from roadeval.data.arrays import Flags, Floats

FARTHEST: Final = 420.0
"""The ground ends here and the far view begins, metres."""
CLOUD_DRIFT: Final = 0.004
"""How far the clouds move in a second, in their own heights."""
UNDER_CAR: Final = 0.85
"""Share of the sky that a car hides from the ground below it."""


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """All that changes: ``time`` seconds, the camera, the light, the other cars."""

    time: float
    camera: Camera
    light: Light
    cars: tuple[Car, ...]


def see(scene: Scene, now: Moment) -> Film:
    """Render the image: sky, ground, then panels from far to near."""
    rays = now.camera.rays()
    film = Film(
        np.zeros(rays.shape, np.float32),
        np.ones(rays.shape[:2], np.float32),
        np.zeros(rays.shape[:2], np.float32),
    )
    down = rays[..., 1] <= -now.camera.pose.y / FARTHEST
    if not down.all():
        rows = _rows(~down)
        drift = CLOUD_DRIFT * now.time
        film.radiance[rows] = scene.sky.radiance(rays[rows], now.light.beam, drift)
    if down.any():
        _lay_ground(film, rays, down, scene, now)
    caught = np.flatnonzero(now.camera.catches(scene.corners)).tolist()
    panels = [scene.panels[i] for i in caught]
    panels += [panel for car in now.cars for panel in car.panels(now.camera.pose.x)]
    haze = air(now.light.beam)
    for panel in sorted(panels, key=lambda panel: -panel.farthest):
        draw(film, now.camera, panel, now.light, haze)
    return film


def _rows(where: Flags) -> slice:
    """Return the rows of ``(H, W)`` in which anything is true."""
    rows = np.flatnonzero(where.any(1))
    return slice(int(rows[0]), int(rows[-1]) + 1)


def _lay_ground(film: Film, rays: Field, down: Flags, scene: Scene, now: Moment) -> None:
    """Lay the ground under the rays that meet it, ``down``."""
    rows, pose = _rows(down), now.camera.pose
    meets = down[rows]
    depth = np.float32(pose.y) / np.maximum(-rays[rows, :, 1], np.float32(pose.y / FARTHEST))
    z = np.float32(pose.z) + depth * rays[rows, :, 2]
    offset = np.float32(pose.x) + depth * rays[rows, :, 0] - scene.road.centre(z)
    middle = depth[:, depth.shape[1] // 2]
    width = middle / np.float32(now.camera.focal)
    length = middle * width / np.float32(pose.y)
    sun = scene.sunlight.sample(offset, z, length)
    hidden = scene.hidden_sky.sample(offset, z, length)
    _shade_by_cars(sun, hidden, rows, scene, now)
    direct = now.light.direct * np.float32(scene.sun.towards[1])
    light = sun[..., None] * direct + (1 - hidden)[..., None] * now.light.sky
    radiance = scene.ground.reflectance(offset, z, width, length) * light
    haze = air(now.light.beam)
    radiance = haze + np.exp(-depth / np.float32(HAZE_LENGTH))[..., None] * (radiance - haze)
    film.radiance[rows][meets] = radiance[meets]
    film.visible[rows][meets] = sun[meets]
    film.road[rows][meets] = scene.road.is_road(offset, z)[meets]


def _shade_by_cars(sun: Field, hidden: Field, rows: slice, scene: Scene, now: Moment) -> None:
    """Take from the ground, in place, the sun and the sky that cars stand before."""
    for car in now.cars:
        for outline in car.shadow(scene.sun):
            sun *= 1 - _cover(outline, now.camera, rows)
        below = cv2.GaussianBlur(_cover(car.footprint(), now.camera, rows), (0, 0), 2.0)
        np.maximum(hidden, np.float32(UNDER_CAR) * below, out=hidden)


def _cover(outline: Floats, camera: Camera, rows: slice) -> Field:
    """``(h, W)`` share of the pixels of some rows that a polygon on the ground covers."""
    cover = np.zeros((rows.stop - rows.start, camera.width), np.uint8)
    corners = camera.outline(outline)
    if len(corners):
        fixed = np.round((corners - (0, rows.start)) * 16).astype(np.int32)
        cv2.fillConvexPoly(cover, fixed, 255, cv2.LINE_AA, 4)
    return np.asarray(cover * np.float32(1 / 255))
