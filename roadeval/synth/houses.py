"""Houses: a box with a gabled roof whose ridge runs along the road."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from roadeval.synth.camera import Matrix
from roadeval.synth.light import Sun
from roadeval.synth.noise import Field, coloured_noise
from roadeval.synth.panel import Panel, Picture
from roadeval.synth.shadows import Silhouettes, SunMap

PIXELS_PER_METRE: Final = 28.0
STOREY: Final = 2.8
WALL_SKY: Final = 0.60
ROOF_SKY: Final = 0.85
"""Shares of level ground's skylight that a wall and a roof get."""
WALLS: Final = ((0.20, 0.12, 0.092), (0.47, 0.44, 0.37), (0.33, 0.27, 0.20), (0.20, 0.15, 0.125))
ROOFS: Final = ((0.20, 0.11, 0.085), (0.13, 0.125, 0.125), (0.17, 0.13, 0.11))
GLASS: Final = (0.045, 0.055, 0.07)
FRAME: Final = (0.62, 0.62, 0.60)


@dataclass(frozen=True, slots=True, eq=False)
class House:
    """A house between two opposite corners of its walls, ``(3,)`` metres each.

    ``low[1]`` is 0 and ``high[1]`` the height of the eaves.
    """

    low: Matrix
    high: Matrix
    ridge: float
    wall: tuple[float, float, float]
    roof: tuple[float, float, float]

    def occlude(self, silhouettes: Silhouettes) -> None:
        """Stand in the sun's way: the walls as a box, the roof as steps."""
        silhouettes.add_box(self.low, self.high)
        eaves, middle = self.high[1], (self.low[0] + self.high[0]) / 2
        for step in np.linspace(0.0, 1.0, 9)[:-1]:
            narrow = (1 - step) * (self.high[0] - self.low[0]) / 2
            bottom = eaves + step * (self.ridge - eaves)
            top = bottom + (self.ridge - eaves) / 8
            silhouettes.add_box(
                np.array([middle - narrow, bottom, self.low[2]]),
                np.array([middle + narrow, top, self.high[2]]),
            )

    def panels(self, shade: SunMap, rng: np.random.Generator) -> tuple[Panel, ...]:
        """Paint what is seen from the road: roof, long wall and gable, in this order."""
        right_of_road = bool(self.low[0] > shade.road.centre(self.low[2:])[0])
        face, outward = (self.low[0], -1.0) if right_of_road else (self.high[0], 1.0)
        middle, eaves = (self.low[0] + self.high[0]) / 2, self.high[1]
        long = np.array([0.0, 0.0, self.high[2] - self.low[2]])
        rise = np.array([face - middle, eaves - self.ridge, 0.0])
        slope = np.array([outward * abs(rise[1]), abs(rise[0]), 0.0]) / np.linalg.norm(rise)
        width = np.array([self.high[0] - self.low[0], 0.0, 0.0])
        roof = Panel(
            _NOTHING, np.array([middle, self.ridge, self.low[2]]) - 0.02 * long, 1.04 * long,
            1.12 * rise,
        )  # fmt: skip
        side = Panel(
            _NOTHING, np.array([face, eaves, self.low[2]]), long, np.array([0.0, -eaves, 0.0])
        )
        gable = Panel(
            _NOTHING, np.array([self.low[0], self.ridge, self.low[2]]), width,
            np.array([0.0, -self.ridge, 0.0]),
        )  # fmt: skip
        outline = np.array(
            [[0, 1], [0, 1 - eaves / self.ridge], [0.5, 0], [1, 1 - eaves / self.ridge], [1, 1]]
        )
        return (
            _painted(roof, _tiles(roof, self.roof, rng), slope, ROOF_SKY, shade),
            _painted(
                side,
                _wall(side, self.wall, eaves, rng),
                np.array([outward, 0.0, 0.0]),
                WALL_SKY,
                shade,
            ),
            _painted(
                gable,
                _wall(gable, self.wall, eaves, rng),
                np.array([0.0, 0.0, -1.0]),
                WALL_SKY,
                shade,
                outline,
            ),
        )


_NOTHING: Final = Picture((), ())


def _size(panel: Panel) -> tuple[int, int]:
    """Rows and columns of a panel's picture."""
    metres = np.linalg.norm(panel.down), np.linalg.norm(panel.right)
    rows, columns = (max(8, round(float(m) * PIXELS_PER_METRE)) for m in metres)
    return rows, columns


def _wall(panel: Panel, colour: tuple[float, float, float], eaves: float,
          rng: np.random.Generator) -> Field:  # fmt: skip
    """Paint bricks or plaster, ``(h, w, 3)`` reflectance, with a row of windows on each storey."""
    rows, columns = _size(panel)
    stains = coloured_noise(rng, (rows, columns), 2, 200, 1.0)
    image = np.float32(colour) * np.exp(0.07 * stains)[..., None]
    metre = PIXELS_PER_METRE
    bays = max(1, int(columns / metre / 2.6))
    for storey in range(int(eaves / STOREY + 0.2)):
        bottom = rows - (storey * STOREY + 0.85) * metre
        for bay in range(bays):
            middle = (bay + 0.5) * columns / bays
            glass = tuple(rng.uniform(0.5, 2.6) * np.array(GLASS))
            for margin, paint in ((0.09, FRAME), (0.0, glass)):
                left, right = (round(middle + s * (0.6 + margin) * metre) for s in (-1, 1))
                top = round(bottom - (1.35 + margin) * metre)
                low = (right, round(bottom + margin * metre))
                cv2.rectangle(image, (left, top), low, paint, -1)
            bar = round(middle)
            cv2.line(image, (bar, round(bottom)), (bar, round(bottom - 1.35 * metre)), FRAME, 1)
    return np.asarray(image, np.float32)


def _tiles(panel: Panel, colour: tuple[float, float, float], rng: np.random.Generator) -> Field:
    """Paint rows of roof tiles, ``(h, w, 3)`` reflectance."""
    rows, columns = _size(panel)
    course = 0.12 * np.cos(2 * np.pi * np.arange(rows) / (0.32 * PIXELS_PER_METRE))
    weather = 0.10 * coloured_noise(rng, (rows, columns), 2, 120, 0.8)
    return np.asarray(np.float32(colour) * np.exp(course[:, None] + weather)[..., None], np.float32)


def _painted(
    panel: Panel, colour: Field, normal: Matrix, sky: float, shade: SunMap,
    outline: Matrix | None = None,
) -> Panel:  # fmt: skip
    """Hang ``colour`` on the panel, in the sun that reaches each of its points."""
    rows, columns = colour.shape[:2]
    right = (np.arange(columns) + 0.5)[None, :, None] / columns * panel.right
    down = (np.arange(rows) + 0.5)[:, None, None] / rows * panel.down
    points = panel.corner + right + down
    facing = shade.sun.facing(normal)
    seen = shade.visible_from(points)
    opacity = np.ones((rows, columns), np.float32)
    if outline is not None:
        opacity[:] = 0.0
        corners = np.round(outline * (columns, rows)).astype(np.int32)
        cv2.fillConvexPoly(opacity, corners, 1.0)
    visible = seen if facing > 0 else np.zeros_like(seen)
    picture = Picture.painted(colour, opacity, facing * seen, sky, visible)
    return Panel(picture, panel.corner, panel.right, panel.down)
