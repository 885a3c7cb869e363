"""Houses: a box with a gabled roof whose ridge runs along the road."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from benchmarks.world.noise import Field, Reflectance, coloured_noise
from benchmarks.world.panel import Panel, Picture
from benchmarks.world.shadows import Silhouettes, SunMap
from roadeval.data.arrays import Floats

PIXELS_PER_METRE: Final = 28.0
STOREY: Final = 2.8
BAY: Final = 2.6
"""Distance between windows, metres."""
WINDOW: Final = (1.2, 1.35)
"""Width and height, metres."""
SILL: Final = 0.85
"""Height of a window's lower edge above its floor, metres."""
COURSE: Final = 0.32
"""Distance between rows of roof tiles, metres."""
ROOF_STEPS: Final = 8
WALL_SKY: Final = 0.60
ROOF_SKY: Final = 0.85
"""Shares of level ground's skylight that a wall and a roof get."""

WALLS: Final[tuple[Reflectance, ...]] = (
    (0.20, 0.12, 0.092), (0.47, 0.44, 0.37), (0.33, 0.27, 0.20), (0.20, 0.15, 0.125),
)  # fmt: skip
ROOFS: Final[tuple[Reflectance, ...]] = (
    (0.20, 0.11, 0.085), (0.13, 0.125, 0.125), (0.17, 0.13, 0.11),
)  # fmt: skip
GLASS: Final = (0.045, 0.055, 0.07)
FRAME: Final = (0.62, 0.62, 0.60)


@dataclass(frozen=True, slots=True, eq=False)
class House:
    """A house between two opposite corners of its walls, ``(3,)`` metres each.

    Parameters
    ----------
    low, high
        The corners; ``low[1]`` is 0 and ``high[1]`` the height of the eaves.
    ridge
        Height of the ridge, metres.
    side
        On which side of the road it stands: -1 left, 1 right.
    wall, roof
        Reflectances.
    """

    low: Floats
    high: Floats
    ridge: float
    side: float
    wall: Reflectance
    roof: Reflectance

    def occlude(self, silhouettes: Silhouettes) -> None:
        """Stand in the sun's way: the walls as a box, the roof as steps."""
        silhouettes.add_box(self.low, self.high)
        middle, half = (self.low[0] + self.high[0]) / 2, (self.high[0] - self.low[0]) / 2
        heights = np.linspace(self.high[1], self.ridge, ROOF_STEPS + 1)
        for k in range(ROOF_STEPS):
            narrow = half * (1 - k / ROOF_STEPS)
            silhouettes.add_box(
                np.array([middle - narrow, heights[k], self.low[2]]),
                np.array([middle + narrow, heights[k + 1], self.high[2]]),
            )

    def panels(self, shade: SunMap, rng: np.random.Generator) -> tuple[Panel, Panel, Panel]:
        """Paint the sides seen from the road: roof, long wall and gable, in this order."""
        face = self.low[0] if self.side > 0 else self.high[0]
        middle, eaves = (self.low[0] + self.high[0]) / 2, self.high[1]
        along = np.array([0.0, 0.0, self.high[2] - self.low[2]])
        across = np.array([self.high[0] - self.low[0], 0.0, 0.0])
        pitch = np.array([face - middle, eaves - self.ridge, 0.0])
        ridge = np.array([middle, self.ridge, self.low[2]])
        roof = Panel(NOTHING, ridge - 0.02 * along, 1.04 * along, 1.12 * pitch)
        wall = Panel(
            NOTHING, np.array([face, eaves, self.low[2]]), along, np.array([0.0, -eaves, 0.0])
        )
        gable = Panel(
            NOTHING,
            np.array([self.low[0], self.ridge, self.low[2]]),
            across,
            np.array([0.0, -self.ridge, 0.0]),
        )
        up = np.array([-self.side * -pitch[1], abs(pitch[0]), 0.0]) / np.linalg.norm(pitch)
        out, towards_us = np.array([-self.side, 0.0, 0.0]), np.array([0.0, 0.0, -1.0])
        gabled = _gabled(_wall(gable, self.wall, eaves, rng), eaves / self.ridge)
        return (
            _lit(roof, _tiles(roof, self.roof, rng), up, ROOF_SKY, shade),
            _lit(wall, _wall(wall, self.wall, eaves, rng), out, WALL_SKY, shade),
            _lit(gable, gabled, towards_us, WALL_SKY, shade),
        )


NOTHING: Final = Picture((), ())
"""Things that hang on a wall before it is painted."""


def _blank(panel: Panel, colour: Reflectance, texture: Field | float) -> Field:
    """``(h, w, 4)`` RGB and opacity of a plain surface as large as the panel."""
    image = np.ones((*_size(panel), 4), np.float32)
    image[..., :3] = colour
    image[..., :3] *= np.exp(np.asarray(texture, np.float32))[..., None]
    return image


def _size(panel: Panel) -> tuple[int, int]:
    """Rows and columns of a panel's picture."""
    rows, columns = (
        max(8, round(float(np.linalg.norm(edge)) * PIXELS_PER_METRE))
        for edge in (panel.down, panel.right)
    )
    return rows, columns


def _wall(panel: Panel, colour: Reflectance, eaves: float, rng: np.random.Generator) -> Field:
    """Paint a wall, ``(h, w, 4)`` RGB and opacity, with a row of windows on each storey."""
    rows, columns = _size(panel)
    image = _blank(panel, colour, 0.07 * coloured_noise(rng, (rows, columns), 2, 200, 1.0))
    bays = max(1, int(columns / PIXELS_PER_METRE / BAY))
    for storey in range(int(eaves / STOREY + 0.2)):
        sill = rows - (storey * STOREY + SILL) * PIXELS_PER_METRE
        for bay in range(bays):
            glass = rng.uniform(0.5, 2.6) * np.array(GLASS)
            _window(image, (bay + 0.5) * columns / bays, sill, glass)
    return image


def _window(image: Field, middle: float, sill: float, glass: Field) -> None:
    """Paint a window about a column, its lower edge at a row."""
    width, height = (PIXELS_PER_METRE * side for side in WINDOW)
    for margin, colour in ((2.5, FRAME), (0.0, tuple(glass.tolist()))):
        top_left = round(middle - width / 2 - margin), round(sill - height - margin)
        low_right = round(middle + width / 2 + margin), round(sill + margin)
        cv2.rectangle(image, top_left, low_right, (*colour, 1.0), -1)
    bar = round(middle)
    cv2.line(image, (bar, round(sill)), (bar, round(sill - height)), (*FRAME, 1.0), 1)


def _gabled(wall: Field, eaves: float) -> Field:
    """Cut the upper corners off a wall: ``eaves`` is their height as a share of the ridge's."""
    rows, columns = wall.shape[:2]
    outline = np.array([[0, 1], [0, 1 - eaves], [0.5, 0], [1, 1 - eaves], [1, 1]])
    inside = np.zeros((rows, columns), np.float32)
    cv2.fillConvexPoly(inside, np.round(outline * (columns, rows)).astype(np.int32), 1.0)
    return np.dstack([wall[..., :3], inside])


def _tiles(panel: Panel, colour: Reflectance, rng: np.random.Generator) -> Field:
    """Paint rows of roof tiles, ``(h, w, 4)`` RGB and opacity."""
    rows, columns = _size(panel)
    courses = 0.12 * np.cos(2 * np.pi * np.arange(rows) / (COURSE * PIXELS_PER_METRE))
    weather = 0.10 * coloured_noise(rng, (rows, columns), 2, 120, 0.8)
    return _blank(panel, colour, courses[:, None] + weather)


def _lit(panel: Panel, image: Field, normal: Floats, sky: float, shade: SunMap) -> Panel:
    """Hang an image on the panel, in the sun that reaches each of its points."""
    rows, columns = image.shape[:2]
    right = (np.arange(columns) + 0.5)[None, :, None] / columns * panel.right
    down = (np.arange(rows) + 0.5)[:, None, None] / rows * panel.down
    facing = shade.sun.facing(normal)
    seen = shade.visible_from(panel.corner + right + down) * np.float32(facing > 0)
    picture = Picture.painted(image, facing * seen, sky, seen)
    return Panel(picture, panel.corner, panel.right, panel.down)
