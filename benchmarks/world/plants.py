"""Trees and bushes: clouds of leaves on branches, lit leaf by leaf and painted once each.

The same leaves cast the shadow on the ground, so the sun's spots on the road are the gaps in
the crown that one sees.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from benchmarks.world.light import Sun
from benchmarks.world.noise import Field
from benchmarks.world.panel import Picture
from benchmarks.world.standing import Rod, Standing
from roadeval.data.arrays import Floats

PIXELS_PER_METRE: Final = 44.0
LEAF: Final = 0.05
"""Radius of a painted cluster of leaves, metres."""
SHADE_CELL: Final = 0.3
"""Leaves within a column of this width stand in each other's light, metres."""
BARK: Final = (0.115, 0.095, 0.075)


@dataclass(frozen=True, slots=True)
class Species:
    """How a kind of plant grows: sizes in metres, colour as reflectance.

    ``crown`` is the crown's height above its base (``stem``), ``spread`` its radius;
    ``taper`` is 0 for a round crown and 1 for a cone.
    """

    stem: float
    crown: float
    spread: float
    tufts: int
    leaves: int
    colour: tuple[float, float, float]
    taper: float = 0.0


OAK: Final = Species(2.6, 6.2, 3.5, 100, 20000, (0.075, 0.115, 0.028))
PLANE: Final = Species(3.2, 7.0, 3.1, 85, 17000, (0.090, 0.125, 0.034))
BIRCH: Final = Species(2.2, 6.5, 1.9, 60, 10000, (0.105, 0.135, 0.040), 0.45)
SPRUCE: Final = Species(0.7, 8.5, 2.1, 90, 13000, (0.040, 0.068, 0.028), 0.95)
BUSH: Final = Species(0.0, 1.5, 1.2, 45, 5000, (0.080, 0.112, 0.030))
SHRUB: Final = Species(0.0, 1.0, 1.0, 35, 3500, (0.110, 0.120, 0.040))
SPECIES: Final = (OAK, PLANE, BIRCH, SPRUCE, BUSH, SHRUB)


def grow(species: Species, sun: Sun, rng: np.random.Generator) -> Standing:
    """Grow a plant and paint it in the light of ``sun``."""
    tufts = _tufts(species, rng)
    leaves = _leaves(species, tufts, rng)
    rods = tuple(_branches(species, tufts, rng))
    half_width, height = _extent(leaves)
    return Standing(_paint(species, leaves, rods, sun, rng), half_width, height, leaves, rods)


def _extent(leaves: Floats) -> tuple[float, float]:
    """Half width and height of the picture that holds all leaves, metres."""
    margin = 2 * LEAF
    return float(np.abs(leaves[:, 0]).max()) + margin, float(leaves[:, 1].max()) + margin


def _tufts(species: Species, rng: np.random.Generator) -> Floats:
    """``(n, 3)`` centres of the tufts that make up the crown, most of them near its surface."""
    direction = rng.normal(size=(species.tufts, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    away = direction * rng.uniform(0.25, 1.0, (species.tufts, 1)) ** 0.5
    level = away[:, 1] / 2 + 0.5
    radius = species.spread * (1.0 - species.taper * level) * rng.uniform(0.8, 1.1, species.tufts)
    height = species.stem + species.crown * (0.08 + 0.84 * level)
    return np.stack([away[:, 0] * radius, height, away[:, 2] * radius], axis=1)


def _leaves(species: Species, tufts: Floats, rng: np.random.Generator) -> Floats:
    """``(n, 3)`` leaves: flattened clouds about the tufts, none below the ground."""
    sizes = rng.gamma(3.0, 1.0, len(tufts))
    tuft = rng.choice(len(tufts), species.leaves, p=sizes / sizes.sum())
    radius = 0.15 * species.spread * (sizes[tuft] / 3.0) ** 0.4
    leaves = tufts[tuft] + rng.normal(size=(species.leaves, 3)) * radius[:, None] * (1, 0.62, 1)
    return np.asarray(leaves[leaves[:, 1] > 0.03])


def _branches(species: Species, tufts: Floats, rng: np.random.Generator) -> Iterator[Rod]:
    """Yield the trunk, then a branch from it to every third tuft."""
    if species.stem == 0.0:
        return
    top = np.array([*rng.normal(0.0, 0.12, 2), species.stem + 0.75 * species.crown])[[0, 2, 1]]
    knots = [np.zeros(3), 0.45 * top + (0.06, 0, 0), 0.75 * top, top]
    for foot, tip, radius in zip(knots, knots[1:], (0.17, 0.12, 0.07), strict=False):
        yield Rod(foot, tip, radius)
    for tuft in tufts[::3]:
        share = np.clip((0.75 * tuft[1] - 0.1) / top[1], 0.25, 0.95)
        bend = share * top + 0.5 * (tuft - share * top) + (0.0, 0.25, 0.0)
        yield Rod(share * top, bend, 0.05)
        yield Rod(bend, tuft, 0.03)


def light_left(points: Floats, towards: Floats, opacity: float) -> Field:
    """Share of a distant light that leaves before a leaf let through to it.

    Parameters
    ----------
    points
        ``(n, 3)`` leaves.
    towards
        ``(3,)`` unit vector to the light.
    opacity
        Share of the light that a leaf takes from the leaves behind it in the same column.

    Returns
    -------
    ndarray
        ``(n,)`` float32.
    """
    aside = np.cross(towards, (0.0, 0.0, 1.0) if abs(towards[2]) < 0.9 else (1.0, 0.0, 0.0))
    aside /= np.linalg.norm(aside)
    plane = np.stack([points @ aside, points @ np.cross(towards, aside)], axis=1)
    cells = np.floor(plane / SHADE_CELL).astype(np.int64)
    column = cells[:, 0] * 100_003 + cells[:, 1]
    order = np.lexsort((-(points @ towards), column))
    first = np.flatnonzero(np.diff(column[order], prepend=column[order[0]] - 1))
    rank = np.arange(len(points)) - np.repeat(first, np.diff(first, append=len(points)))
    left = np.empty(len(points), np.float32)
    left[order] = (1.0 - opacity) ** rank
    return left


def _paint(
    species: Species, leaves: Floats, rods: Sequence[Rod], sun: Sun, rng: np.random.Generator
) -> Picture:
    """Paint the far half of the leaves, then the wood, then the near half."""
    middles = np.array([(rod.foot + rod.tip) / 2 for rod in rods]).reshape(-1, 3)
    everything = np.concatenate([leaves, middles])
    visible = light_left(everything, sun.towards, 0.16)
    sky = 0.25 + 0.75 * light_left(everything, np.array([0.0, 1.0, 0.0]), 0.10)
    tint = np.array(species.colour) * np.exp(rng.normal(0.0, (0.15, 0.10, 0.15), leaves.shape))
    leaf = slice(len(leaves))
    direct = tint * (visible[leaf] * rng.uniform(0.35, 1.0, len(leaves)))[:, None]
    by_sun = np.column_stack([direct, np.ones(len(leaves))])
    by_sky = np.column_stack([tint * sky[leaf, None], visible[leaf]])
    canvas = _Canvas.stretched(*_extent(leaves))
    order = np.argsort(-leaves[:, 2])
    behind, before = np.split(order, [np.count_nonzero(leaves[:, 2] > 0)])
    canvas.leaves(leaves[behind], by_sun[behind], by_sky[behind], rng)
    for rod, seen, lit in zip(rods, visible[len(leaves) :], sky[len(leaves) :], strict=True):
        canvas.wood(rod, float(seen), float(lit), sun)
    canvas.leaves(leaves[before], by_sun[before], by_sky[before], rng)
    return Picture.of(canvas.sun, canvas.sky)


@dataclass(frozen=True, slots=True, eq=False)
class _Canvas:
    """The two images of a `Picture` while it is being painted."""

    sun: Field
    sky: Field
    half_width: float

    @classmethod
    def stretched(cls, half_width: float, height: float) -> _Canvas:
        """Return an empty canvas of that size, metres."""
        size = round(height * PIXELS_PER_METRE), round(2 * half_width * PIXELS_PER_METRE), 4
        return cls(np.zeros(size, np.float32), np.zeros(size, np.float32), half_width)

    def pixels(self, points: Floats) -> list[list[int]]:
        """Column and row of each of ``(n, 3)`` points."""
        column = (points[:, 0] + self.half_width) * PIXELS_PER_METRE
        row = self.sun.shape[0] - points[:, 1] * PIXELS_PER_METRE
        pixels: list[list[int]] = np.rint(np.stack([column, row], axis=1)).astype(int).tolist()
        return pixels

    def leaves(self, at: Floats, by_sun: Field, by_sky: Field, rng: np.random.Generator) -> None:
        """Paint clusters of leaves in order, as small turned ellipses."""
        radii = rng.uniform((0.55, 0.3), (1.2, 0.8), (len(at), 2)) * LEAF * PIXELS_PER_METRE
        for centre, axes, angle, sun, sky in zip(
            self.pixels(at),
            np.rint(radii).astype(int).clip(1).tolist(),
            rng.uniform(0, 180, len(at)).tolist(),
            by_sun.tolist(),
            by_sky.tolist(),
            strict=True,
        ):
            cv2.ellipse(self.sun, centre, axes, angle, 0, 360, sun, -1)
            cv2.ellipse(self.sky, centre, axes, angle, 0, 360, sky, -1)

    def wood(self, rod: Rod, visible: float, sky: float, sun: Sun) -> None:
        """Paint a rod as strips, brighter on the side of the sun."""
        for side in np.linspace(-0.8, 0.8, 5):
            normal = np.array([side, 0.0, -np.sqrt(1 - side**2)])
            direct = visible * sun.facing(normal)
            aside = np.array([side * rod.radius, 0.0, 0.0])
            foot, tip = self.pixels(np.stack([rod.foot, rod.tip]) + aside)
            width = max(1, round(0.6 * rod.radius * PIXELS_PER_METRE))
            lit, shaded = (np.array(BARK) * direct).tolist(), (np.array(BARK) * sky * 0.7).tolist()
            cv2.line(self.sun, foot, tip, (*lit, 1.0), width)
            cv2.line(self.sky, foot, tip, (*shaded, visible if direct > 0 else 0.0), width)
