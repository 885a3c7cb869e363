"""Lamp posts, telegraph poles and road signs: rods with a round shade."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from benchmarks.world.light import Sun
from benchmarks.world.noise import Field, Reflectance
from benchmarks.world.panel import Picture
from benchmarks.world.standing import NO_LEAVES, Rod, Standing

PIXELS_PER_METRE: Final = 50.0
SKY_ON_WALL: Final = 0.62
"""Share of level ground's skylight that an upright surface gets, the ground's own included."""
STEEL: Final = (0.26, 0.27, 0.27)
WOOD: Final = (0.17, 0.135, 0.105)
LAMP: Final = (0.45, 0.45, 0.44)
RED: Final = (0.52, 0.045, 0.04)
WHITE: Final = (0.74, 0.74, 0.73)
BLACK: Final = (0.05, 0.05, 0.05, 1.0)


class _Easel:
    """A picture in the making, as wide as it is needed, with the foot in the middle below."""

    def __init__(self, half_width: float, height: float, sun: Sun) -> None:
        size = round(height * PIXELS_PER_METRE), round(2 * half_width * PIXELS_PER_METRE)
        self.half_width, self.height, self.sun = half_width, height, sun
        self.image = np.zeros((*size, 4), np.float32)
        self.direct = np.full(size, sun.facing(np.array([0.0, 0.0, -1.0])), np.float32)
        self.rods: list[Rod] = []

    def rod(self, foot: tuple[float, float], tip: tuple[float, float], radius: float,
            colour: Reflectance) -> None:  # fmt: skip
        """Add a cylinder from ``foot`` to ``tip`` (X and Y), shaded across."""
        for side in np.linspace(-0.8, 0.8, 5):
            normal = np.array([side, 0.0, -np.sqrt(1 - side**2)])
            low, high = (self.pixel(x + side * radius, y) for x, y in (foot, tip))
            width = max(1, round(0.6 * radius * PIXELS_PER_METRE))
            cv2.line(self.image, low, high, (*colour, 1.0), width)
            cv2.line(self.direct, low, high, self.sun.facing(normal), width)
        self.rods.append(Rod(np.array([*foot, 0.0]), np.array([*tip, 0.0]), radius))

    def disc(self, centre: tuple[float, float], radius: float, colour: Reflectance) -> None:
        """Add a round plate that faces the camera."""
        at, size = self.pixel(*centre), round(radius * PIXELS_PER_METRE)
        cv2.circle(self.image, at, size, (*colour, 1.0), -1)
        facing = self.sun.facing(np.array([0.0, 0.0, -1.0]))
        cv2.circle(self.direct, at, size, facing, -1)

    def pixel(self, x: float, y: float) -> tuple[int, int]:
        """Column and row of a point."""
        column = (x + self.half_width) * PIXELS_PER_METRE
        return round(column), round((self.height - y) * PIXELS_PER_METRE)

    def finished(self) -> Standing:
        """Return the thing, painted."""
        lit: Field = (self.direct > 0).astype(np.float32)
        picture = Picture.painted(self.image, self.direct, SKY_ON_WALL, lit)
        return Standing(picture, self.half_width, self.height, NO_LEAVES, tuple(self.rods))


def lamp_post(sun: Sun, towards_road: int) -> Standing:
    """Return a 7.5 m street lamp whose arm reaches to the left (-1) or to the right (1)."""
    easel = _Easel(1.9, 7.8, sun)
    easel.rod((0.0, 0.0), (0.0, 7.2), 0.075, STEEL)
    easel.rod((0.0, 7.2), (1.3 * towards_road, 7.55), 0.045, STEEL)
    easel.rod((1.2 * towards_road, 7.52), (1.8 * towards_road, 7.62), 0.09, LAMP)
    return easel.finished()


def telegraph_pole(sun: Sun) -> Standing:
    """Return an 8 m wooden pole with a crossarm."""
    easel = _Easel(1.0, 8.2, sun)
    easel.rod((0.0, 0.0), (0.0, 8.1), 0.14, WOOD)
    easel.rod((-0.9, 7.5), (0.9, 7.5), 0.055, WOOD)
    for x in (-0.8, -0.4, 0.4, 0.8):
        easel.rod((x, 7.52), (x, 7.7), 0.035, LAMP)
    return easel.finished()


def speed_sign(sun: Sun) -> Standing:
    """Return a round sign, red and white, on a 2.6 m post."""
    easel = _Easel(0.4, 2.7, sun)
    easel.rod((0.0, 0.0), (0.0, 2.6), 0.04, STEEL)
    easel.disc((0.0, 2.3), 0.31, RED)
    easel.disc((0.0, 2.3), 0.24, WHITE)
    for x, y, axes, opening in (
        (-0.09, 2.35, (3, 2), 130),
        (-0.09, 2.25, (3, 3), 130),
        (0.08, 2.30, (3, 5), 180),
    ):
        centre = easel.pixel(x, y)
        cv2.ellipse(easel.image, centre, axes, 0, -opening, opening, BLACK, 2)
    return easel.finished()
