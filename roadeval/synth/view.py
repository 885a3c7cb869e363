"""One view of the scene: from a pose and the light of a moment to what the camera sees."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np

from roadeval.synth.camera import Camera, Matrix
from roadeval.synth.cars import Car
from roadeval.synth.light import Light
from roadeval.synth.noise import Field
from roadeval.synth.panel import HAZE_LENGTH, Film, draw
from roadeval.synth.scene import Scene
from roadeval.synth.sky import HORIZON

FARTHEST: Final = 420.0
"""The ground ends here and the far view begins, metres."""
UNDER_CAR: Final = 0.85
"""Share of the sky that a car hides from the ground below it."""
CLOUD_DRIFT: Final = 0.004
"""How far the clouds move in a second, in their own heights."""


def see(scene: Scene, cars: Sequence[Car], camera: Camera, light: Light, time: float) -> Film:
    """Render what a camera sees at ``time`` seconds: sky, ground, then panels, far to near."""
    rays = camera.rays()
    film = Film(
        np.zeros(rays.shape, np.float32),
        np.ones(rays.shape[:2], np.float32),
        np.zeros(rays.shape[:2], np.float32),
    )
    air = HORIZON * np.float32(0.4 + 0.6 * light.beam)
    horizon = -camera.pose.y / FARTHEST
    above = np.flatnonzero((rays[..., 1] > horizon).any(1))
    below = np.flatnonzero((rays[..., 1] <= horizon).any(1))
    if above.size:
        rows = slice(above[0], above[-1] + 1)
        film.radiance[rows] = scene.sky.radiance(rays[rows], light.beam, CLOUD_DRIFT * time)
    if below.size:
        _ground(film, slice(below[0], below[-1] + 1), rays, scene, cars, camera, light, air)
    caught = np.flatnonzero(camera.catches(scene.corners)).tolist()
    panels = [scene.panels[i] for i in caught]
    panels += [panel for car in cars for panel in car.panels(camera.pose.x)]
    for panel in sorted(panels, key=lambda panel: -panel.farthest):
        draw(film, camera, panel, light, air)
    return film


def _ground(
    film: Film,
    rows: slice,
    rays: Field,
    scene: Scene,
    cars: Sequence[Car],
    camera: Camera,
    light: Light,
    air: Field,
) -> None:
    """Lay the ground under the rays that meet it."""
    seen = rays[rows]
    meets = seen[..., 1] <= -camera.pose.y / FARTHEST
    depth = np.float32(-camera.pose.y) / np.minimum(seen[..., 1], -camera.pose.y / FARTHEST)
    z = np.float32(camera.pose.z) + depth * seen[..., 2]
    offset = np.float32(camera.pose.x) + depth * seen[..., 0] - scene.road.centre(z)
    middle = depth[:, depth.shape[1] // 2]
    width = middle / np.float32(camera.focal)
    length = middle * width / np.float32(camera.pose.y)
    sun = scene.sunlight.sample(offset, z, length)
    hidden = scene.hidden_sky.sample(offset, z, length)
    for car in cars:
        for outline in car.shadow(scene.sun):
            sun *= 1 - _cover(outline, camera, rows)
        below = cv2.GaussianBlur(_cover(car.footprint(), camera, rows), (0, 0), 2.0)
        hidden = np.maximum(hidden, np.float32(UNDER_CAR) * below)
    level = np.float32(scene.sun.towards[1])
    light_on_it = (sun * level)[..., None] * light.direct + (1 - hidden)[..., None] * light.sky
    radiance = scene.ground.reflectance(offset, z, width, length) * light_on_it
    clear = np.exp(-depth / np.float32(HAZE_LENGTH))[..., None]
    radiance = air + clear * (radiance - air)
    film.radiance[rows][meets] = radiance[meets]
    film.visible[rows][meets] = sun[meets]
    film.road[rows][meets] = scene.road.is_road(offset, z)[meets]


def _cover(outline: Matrix, camera: Camera, rows: slice) -> Field:
    """``(h, W)`` share of the pixels of some rows that a polygon on the ground covers."""
    cover = np.zeros((rows.stop - rows.start, camera.width), np.uint8)
    corners = camera.outline(outline)
    if len(corners):
        fixed = np.round((corners - (0, rows.start)) * 16).astype(np.int32)
        cv2.fillConvexPoly(cover, fixed, 255, cv2.LINE_AA, 4)
    return cover * np.float32(1 / 255)
