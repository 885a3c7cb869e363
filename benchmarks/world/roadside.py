"""The places of things beside the road, which make a suburb of a list of plants."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from benchmarks.world import plants, posts
from benchmarks.world.grass import grass_strip
from benchmarks.world.houses import ROOFS, STOREY, WALLS, House
from benchmarks.world.journey import Journey, Stretch
from benchmarks.world.light import Sun
from benchmarks.world.panel import Panel
from benchmarks.world.road import HALF_WIDTH, Road
from benchmarks.world.shadows import Silhouettes, SunMap
from benchmarks.world.standing import Standing
from roadeval.data.arrays import Floats

BEHIND: Final = 15.0
"""Things stand from this far behind the start ..."""
AHEAD: Final = 190.0
"""... to this far beyond the end of the drive, metres."""
GRASS_AHEAD: Final = 80.0
"""Grass stands up to this far beyond the end: farther on it would not be seen, metres."""
SPECIMENS: Final = 3
"""Plants grown of each species; the same ones stand again and again, in other sizes."""
LOW: Final = 2.0
"""Things lower than this get the sun that the things above them let through, metres."""
SIDES: Final = (-1.0, 1.0)
"""Left and right of the road."""

Span = tuple[float, float]
"""From where to where, metres (or times its size, for a scale)."""


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A standing thing with its foot at ``(3,)`` metres, ``scale`` times its size."""

    thing: Standing
    foot: Floats
    scale: float

    def occlude(self, silhouettes: Silhouettes) -> None:
        """Stand in the sun's way."""
        self.thing.occlude(silhouettes, self.foot, self.scale)

    def panel(self, shade: SunMap) -> Panel:
        """Return its panel; low things stand in the shade of high ones."""
        panel = self.thing.panel(self.foot, self.scale)
        height = self.scale * self.thing.height
        if height > LOW:
            return panel
        about = self.foot + np.array([(x, height / 2, 0.0) for x in (-0.3, 0.0, 0.3)])
        return replace(panel, sunlit=float(shade.visible_from(about[None]).mean()))

    def is_in(self, house: House) -> bool:
        """Return whether it stands in a house, or behind it and hides the wall."""
        x, _, z = self.foot
        beyond = x > house.low[0] - 2.5 if house.side > 0 else x < house.high[0] + 2.5
        return bool(beyond and house.low[2] - 4 < z < house.high[2] + 4)


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """A row of plants: species, density, distance from the asphalt's edge, and size."""

    kinds: list[Standing]
    spacing: Span
    away: Span
    scales: Span = (1.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Roadside:
    """Draws where things stand along a journey."""

    journey: Journey
    road: Road
    sun: Sun
    rng: np.random.Generator

    @property
    def end(self) -> float:
        """Where the drive ends, metres."""
        return self.journey.distance(self.journey.duration)

    @property
    def whole(self) -> Span:
        """All that may be seen."""
        return -BEHIND, self.end + AHEAD

    @property
    def sunny(self) -> float:
        """The side of the road that the sun is on: things there shade the road."""
        return float(np.sign(self.sun.azimuth))

    @property
    def avenue(self) -> Span:
        """The part of the road with large trees: the view ahead in the stretch of heavy shadow.

        Seen from a stretch in the sun it has to begin later than from one under the cloud.
        """
        enter, leave = self.journey.extent(Stretch.HEAVY)
        in_the_sun = self.journey.stretches[1] == Stretch.HEAVY
        return enter + (9.0 if in_the_sun else -7.0), leave + 38.0

    def clear_of(self, houses: Iterable[House]) -> Iterator[Placed]:
        """Yield plants and posts that do not stand in one of the houses."""
        houses = list(houses)
        for rows in (self._vegetation(), self._posts()):
            yield from (one for one in rows if not any(one.is_in(house) for house in houses))

    def houses(self) -> Iterator[House]:
        """Yield a tall house that shades the avenue, and lower ones farther back."""
        enter, leave = self.journey.extent(Stretch.HEAVY)
        tall = enter + self.rng.uniform(0.35, 0.6) * (leave - enter) + 8.0
        yield self._house(self.sunny, tall, 6.8, 3)
        for side in SIDES:
            z = self.rng.uniform(12.0, 30.0)
            while z < self.whole[1]:
                if side != self.sunny or abs(z - tall) > 22.0:
                    yield self._house(side, z, self.rng.uniform(8.6, 15.6), 2)
                z += self.rng.uniform(24.0, 60.0)

    def _vegetation(self) -> Iterator[Placed]:
        """Yield the trees of the road, grass and shrubs, and the wood that closes the view."""
        oak, plane, birch, spruce, bush, shrub = (
            [plants.grow(species, self.sun, self.rng) for _ in range(SPECIMENS)]
            for species in plants.SPECIES
        )
        blades = [grass_strip(self.sun, self.rng) for _ in range(SPECIMENS)]
        wood = oak + plane + birch + spruce
        for side in SIDES:
            yield from self._trees(oak + plane, birch + plane, side)
            for away in ((1.0, 2.0), (2.0, 4.0), (4.0, 7.5)):
                grass = Row(blades, (0.8, 2.2), away, (0.7, 1.3))
                yield from self._plant(grass, side, (0.0, self.end + GRASS_AHEAD))
            yield from self._plant(Row(shrub, (3.0, 12.0), (2.8, 7.0), (0.35, 0.8)), side)
            hedge = self.rng.uniform(0.1, 0.8) * self.end
            dense = Row(bush + shrub, (1.1, 1.6), (6.0, 6.4), (0.9, 1.15))
            yield from self._plant(dense, side, (hedge, hedge + 38.0))
            yield from self._plant(Row(bush, (1.2, 3.5), (14.0, 22.0), (1.0, 1.9)), side)
            yield from self._plant(Row(wood, (3.5, 8.0), (20.0, 44.0), (0.7, 1.3)), side)
        for x in np.arange(-64.0, 60.0, 3.0):
            z = self.whole[1] + self.rng.uniform(0.0, 30.0)
            yield Placed(self._any(wood), self._foot(1.0, x, z), self.rng.uniform(0.8, 1.4))

    def _trees(self, large: list[Standing], slim: list[Standing], side: float) -> Iterator[Placed]:
        """Yield an avenue of large trees and, before and after it, scattered slim ones."""
        begin, end = self.avenue
        yield from self._plant(Row(large, (6.5, 9.0), (2.2, 3.1), (0.95, 1.25)), side, (begin, end))
        spacing = (10.0, 17.0) if side == self.sunny else (20.0, 34.0)
        scattered = Row(slim, spacing, (2.8, 4.6), (0.58, 0.85))
        for stretch in ((self.whole[0], begin), (end, self.whole[1])):
            yield from self._plant(scattered, side, stretch)

    def _posts(self) -> Iterator[Placed]:
        """Yield lamps on the sunny side, telegraph poles on the other, and signs."""
        lamp = posts.lamp_post(self.sun, -int(self.sunny))
        yield from self._plant(Row([lamp], (28.0, 30.0), (2.5, 2.6)), self.sunny)
        pole = posts.telegraph_pole(self.sun)
        yield from self._plant(Row([pole], (36.0, 40.0), (3.5, 3.7)), -self.sunny)
        sign = posts.speed_sign(self.sun)
        yield from self._plant(Row([sign], (55.0, 75.0), (1.4, 1.5)), 1.0)

    def _plant(self, row: Row, side: float, stretch: Span | None = None) -> Iterator[Placed]:
        """Yield a row of things along one side of the road."""
        begin, end = stretch or self.whole
        z = begin + self.rng.uniform(0.0, 0.5) * row.spacing[0]
        while z < end:
            foot = self._foot(side, self.rng.uniform(*row.away), z)
            yield Placed(self._any(row.kinds), foot, self.rng.uniform(*row.scales))
            z += self.rng.uniform(*row.spacing)

    def _any(self, kinds: list[Standing]) -> Standing:
        return kinds[self.rng.integers(len(kinds))]

    def _foot(self, side: float, away: float, z: float) -> Floats:
        """``(3,)`` point of the ground ``away`` metres from the asphalt's left or right edge."""
        at = np.array([z])
        left, right = self.road.edges(at)
        edge = float(self.road.centre(at)[0] + (right[0] if side > 0 else left[0]))
        return np.array([edge + side * away, 0.0, z])

    def _house(self, side: float, z: float, away: float, storeys: int) -> House:
        """Return a house whose long wall is ``away`` metres from the asphalt."""
        width, length = self.rng.uniform(7.5, 9.5), self.rng.uniform(9.0, 14.0)
        eaves = storeys * STOREY + self.rng.uniform(0.0, 0.4)
        x = float(self.road.centre(np.array([z + length / 2]))[0])
        near, far = (x + side * (HALF_WIDTH + away + depth) for depth in (0.0, width))
        return House(
            np.array([min(near, far), 0.0, z]),
            np.array([max(near, far), eaves, z + length]),
            eaves + 0.33 * width,
            side,
            WALLS[self.rng.integers(len(WALLS))],
            ROOFS[self.rng.integers(len(ROOFS))],
        )
