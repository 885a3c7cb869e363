"""The place: which things stand where beside the road, and what they make of the light."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from roadeval.synth import plants, posts
from roadeval.synth.camera import Matrix
from roadeval.synth.grass import grass_strip
from roadeval.synth.ground import Ground
from roadeval.synth.houses import ROOFS, STOREY, WALLS, House
from roadeval.synth.journey import Journey, Stretch
from roadeval.synth.light import Sun
from roadeval.synth.panel import Panel
from roadeval.synth.road import Bend, Road
from roadeval.synth.shadows import Silhouettes, SunMap
from roadeval.synth.sky import Sky
from roadeval.synth.standing import Standing
from roadeval.synth.texture import GroundTexture

BEHIND: Final = 15.0
"""Things stand from this far behind the start ..."""
AHEAD: Final = 190.0
"""... to this far beyond the end of the drive, metres."""
SHADED_AHEAD: Final = 110.0
"""Shadows on the ground are drawn up to this far beyond the end, metres."""
SPECIMENS: Final = 3
"""Plants grown of each species; the same ones stand again and again, in other sizes."""
LOW: Final = 2.0
"""What is lower than this gets the sun that the things above it let through, metres."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """All that does not move.

    ``sunlight`` is the share of the sun's disc seen from the ground and ``hidden_sky`` the share
    of the sky that is not. ``corners`` are
    those of the panels, ``(n, 4, 3)``. ``shade`` tells the sun's
    visible share above the ground, for what moves through it.
    """

    sun: Sun
    road: Road
    ground: Ground
    sunlight: GroundTexture
    hidden_sky: GroundTexture
    shade: SunMap
    panels: tuple[Panel, ...]
    corners: Matrix
    sky: Sky


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A standing thing with its foot at ``(3,)`` metres, ``scale`` times its size."""

    thing: Standing
    foot: Matrix
    scale: float

    def panel(self, shade: SunMap) -> Panel:
        """Return its panel; what is low stands in the shade of what is high."""
        panel = self.thing.panel(self.foot, self.scale)
        height = self.scale * self.thing.height
        if height > LOW:
            return panel
        about = self.foot + np.array([(x, height / 2, 0.0) for x in (-0.3, 0.0, 0.3)])
        return replace(panel, sunlit=float(shade.visible_from(about[None]).mean()))


def build(journey: Journey, rng: np.random.Generator) -> Scene:
    """Build a scene for a journey: choose sun and road, set things up, cast their shadows."""
    side = float(rng.choice([-1.0, 1.0]))
    sun = Sun(np.radians(rng.uniform(36, 46)), side * np.radians(rng.uniform(62, 105)))
    end = journey.distance(journey.duration)
    road = _road(end, rng)
    layout = _Layout(journey, road, sun, end, rng)
    houses = list(layout.houses())
    placed = [p for p in layout.standing() if not any(_inside(p, house) for house in houses)]
    silhouettes = Silhouettes(road, sun, -BEHIND, end + SHADED_AHEAD)
    for house in houses:
        house.occlude(silhouettes)
    for one in placed:
        one.thing.occlude(silhouettes, one.foot, one.scale)
    shade = silhouettes.cast()
    panels = [one.panel(shade) for one in placed]
    for house in houses:
        panels.extend(house.panels(shade, rng))
    sunlight = shade.ground()
    return Scene(
        sun, road, Ground.laid(road, rng), sunlight, shade.hidden_sky(sunlight), shade,
        tuple(panels), np.stack([panel.corners() for panel in panels]), Sky.painted(sun, rng),
    )  # fmt: skip


def _road(end: float, rng: np.random.Generator) -> Road:
    """Draw a winding road with a lay-by somewhere along the drive."""
    bends = (
        Bend(rng.uniform(4.5, 6.5), rng.uniform(230, 300), rng.uniform(0, 2 * np.pi)),
        Bend(rng.uniform(0.5, 0.9), rng.uniform(80, 110), rng.uniform(0, 2 * np.pi)),
    )
    begin = rng.uniform(0.35, 0.75) * end
    return Road(bends, (begin, begin + 42.0))


def _inside(placed: Placed, house: House) -> bool:
    """Whether a thing would stand in a house, or behind it, where it would hide the wall."""
    x, _, z = placed.foot
    if not house.low[2] - 4 < z < house.high[2] + 4:
        return False
    return bool(x > house.low[0] - 2.5 if house.low[0] > 0 else x < house.high[0] + 2.5)


@dataclass(frozen=True, slots=True, eq=False)
class _Layout:
    """Draws where things stand."""

    journey: Journey
    road: Road
    sun: Sun
    end: float
    rng: np.random.Generator

    @property
    def sunny(self) -> float:
        """The side of the road that the sun is on: things there shade the road. -1 or 1."""
        return float(np.sign(self.sun.azimuth))

    def standing(self) -> Iterator[Placed]:
        """Yield plants and posts."""
        grown = {
            species: [plants.grow(species, self.sun, self.rng) for _ in range(SPECIMENS)]
            for species in (plants.OAK, plants.PLANE, plants.BIRCH, plants.SPRUCE,
                            plants.BUSH, plants.SHRUB)
        }  # fmt: skip
        tall = grown[plants.OAK] + grown[plants.PLANE]
        slim = grown[plants.BIRCH] + grown[plants.PLANE]
        heavy = self.journey.extent(Stretch.HEAVY)
        exposed = self.journey.stretches[1] == Stretch.HEAVY
        avenue = (heavy[0] + (9.0 if exposed else -7.0), heavy[1] + 38.0)
        for side in (-1.0, 1.0):
            near = (2.2, 3.1)
            yield from self._row(tall, side, avenue, (6.5, 9.0), near, (0.95, 1.25))
            spacing = (10.0, 17.0) if side == self.sunny else (20.0, 34.0)
            for stretch in ((-BEHIND, avenue[0]), (avenue[1], self.end + AHEAD)):
                yield from self._row(slim, side, stretch, spacing, (2.8, 4.6), (0.58, 0.85))
        yield from self._posts()
        strips = [grass_strip(self.sun, self.rng) for _ in range(4)]
        verge = (0.0, self.end + SHADED_AHEAD)
        for side in (-1.0, 1.0):
            for away in ((1.0, 2.0), (2.0, 4.0), (4.0, 7.5)):
                yield from self._row(strips, side, verge, (0.8, 2.2), away, (0.7, 1.3))
        yield from self._undergrowth(grown)

    def _row(
        self,
        kinds: list[Standing],
        side: float,
        stretch: tuple[float, float],
        spacing: tuple[float, float],
        away: tuple[float, float],
        scales: tuple[float, float],
    ) -> Iterator[Placed]:
        """Yield things along one side (-1 left, 1 right), some way from the asphalt's edge."""
        z = stretch[0] + self.rng.uniform(0.0, 0.5) * spacing[0]
        while z < stretch[1]:
            thing = kinds[self.rng.integers(len(kinds))]
            foot = self._foot(side, self.rng.uniform(*away), z)
            yield Placed(thing, foot, self.rng.uniform(*scales))
            z += self.rng.uniform(*spacing)

    def _posts(self) -> Iterator[Placed]:
        """Yield lamps on the sunny side, telegraph poles on the other, and signs."""
        whole = (-BEHIND, self.end + AHEAD)
        lamp = posts.lamp_post(self.sun, -int(self.sunny))
        yield from self._row([lamp], self.sunny, whole, (28.0, 30.0), (2.5, 2.6), (1.0, 1.0))
        pole = posts.telegraph_pole(self.sun)
        yield from self._row([pole], -self.sunny, whole, (36.0, 40.0), (3.5, 3.7), (1.0, 1.02))
        sign = posts.speed_sign(self.sun)
        yield from self._row([sign], 1.0, whole, (55.0, 75.0), (1.4, 1.5), (1.0, 1.0))

    def _undergrowth(self, grown: dict[plants.Species, list[Standing]]) -> Iterator[Placed]:
        """Yield hedges, shrubs, and the wood that closes the view to the sides."""
        low, bush = grown[plants.SHRUB], grown[plants.BUSH] + grown[plants.SHRUB]
        wood = [t for species in (plants.OAK, plants.PLANE, plants.BIRCH, plants.SPRUCE)
                for t in grown[species]]  # fmt: skip
        whole = (0.0, self.end + AHEAD)
        for side in (-1.0, 1.0):
            yield from self._row(low, side, whole, (3.0, 12.0), (2.8, 7.0), (0.35, 0.8))
            hedge = self.rng.uniform(0.1, 0.8) * self.end
            yield from self._row(
                bush, side, (hedge, hedge + 38.0), (1.1, 1.6), (6.0, 6.4), (0.9, 1.15)
            )
            yield from self._row(bush, side, whole, (1.2, 3.5), (14.0, 22.0), (1.0, 1.9))
            yield from self._row(wood, side, whole, (3.5, 8.0), (20.0, 44.0), (0.7, 1.3))
        end = self.end + AHEAD
        for away in np.arange(-64.0, 60.0, 3.0):
            thing = wood[self.rng.integers(len(wood))]
            z = end + self.rng.uniform(0.0, 30.0)
            yield Placed(thing, self._foot(1.0, away, z), self.rng.uniform(0.8, 1.4))

    def houses(self) -> Iterator[House]:
        """Yield a tall house whose shadow reaches the avenue, and lower ones farther back."""
        heavy = self.journey.extent(Stretch.HEAVY)
        tall = heavy[0] + self.rng.uniform(0.35, 0.6) * (heavy[1] - heavy[0]) + 8.0
        yield self._house(self.sunny, tall, 10.2, 3)
        for side in (-1.0, 1.0):
            z = self.rng.uniform(12.0, 30.0)
            while z < self.end + AHEAD:
                clear = side != self.sunny or not tall - 22.0 < z < tall + 22.0
                if clear:
                    yield self._house(side, z, self.rng.uniform(12.0, 19.0), 2)
                z += self.rng.uniform(24.0, 60.0)

    def _house(self, side: float, z: float, face: float, storeys: int) -> House:
        """Return a house whose long wall is ``face`` metres from the road's middle."""
        width, length = self.rng.uniform(7.5, 9.5), self.rng.uniform(9.0, 14.0)
        eaves = storeys * STOREY + self.rng.uniform(0.0, 0.4)
        x = float(self.road.centre(np.array([z + length / 2]))[0])
        near, far = x + side * face, x + side * (face + width)
        wall = WALLS[self.rng.integers(len(WALLS))]
        roof = ROOFS[self.rng.integers(len(ROOFS))]
        low = np.array([min(near, far), 0.0, z])
        high = np.array([max(near, far), eaves, z + length])
        return House(low, high, eaves + 0.33 * width, wall, roof)

    def _foot(self, side: float, away: float, z: float) -> Matrix:
        """``(3,)`` point of the ground ``away`` metres from the asphalt's left or right edge."""
        at = np.array([z])
        left, right = self.road.edges(at)
        edge = float(self.road.centre(at)[0] + (right[0] if side > 0 else left[0]))
        return np.array([edge + side * away, 0.0, z])
