"""Other vehicles: a car ahead, some that come towards the camera, one parked in the lay-by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.world.cars import LENGTH, WIDTH, Car, CarPaint, paint
from benchmarks.world.journey import LANE, SPEED, Journey
from benchmarks.world.light import Sun
from benchmarks.world.noise import Field, Reflectance
from benchmarks.world.road import HALF_WIDTH, Road
from benchmarks.world.shadows import SunMap

COLOURS: Final[tuple[Reflectance, ...]] = (
    (0.42, 0.43, 0.44), (0.62, 0.62, 0.60), (0.05, 0.05, 0.055), (0.05, 0.08, 0.17),
    (0.30, 0.04, 0.035), (0.16, 0.17, 0.18),
)  # fmt: skip
ONCOMING: Final = 3
"""Cars that come towards us in the whole drive."""


@dataclass(frozen=True, slots=True, eq=False)
class Mover:
    """A car that keeps its offset from the centre line; ``z`` metres at time 0."""

    look: CarPaint
    offset: float
    z: float
    speed: float

    def at(self, time: float, road: Road, shade: SunMap) -> Car:
        """Return the car at ``time`` seconds."""
        z = np.array([self.z + self.speed * time])
        foot = np.array([float(road.centre(z)[0]) + self.offset, 0.0, float(z[0])])
        heading = float(np.arctan(road.slope(z)[0]))
        body = foot + np.array([(0.0, y, 0.5 * LENGTH) for y in (0.5, 1.0)])
        seen: Field = shade.visible_from(body[None])
        return Car(self.look, foot, heading, float(seen.mean()))


def draw_traffic(journey: Journey, road: Road, sun: Sun, rng: np.random.Generator) -> list[Mover]:
    """Draw the cars of a drive."""
    colours = [COLOURS[i] for i in rng.permutation(len(COLOURS))]
    ahead, parked = (paint(colour, False, sun) for colour in colours[:2])
    parking = HALF_WIDTH + 0.25 + WIDTH / 2
    movers = [
        Mover(ahead, LANE + rng.uniform(-0.15, 0.15), rng.uniform(26, 34), 1.03 * SPEED),
        Mover(parked, parking, (road.bay[0] + road.bay[1]) / 2 + rng.uniform(-6, 4), 0.0),
    ]
    for k in range(ONCOMING):
        look = paint(colours[2 + k], True, sun)
        meets = (k + rng.uniform(0.2, 0.8)) / ONCOMING * journey.duration
        speed = rng.uniform(0.85, 1.1) * SPEED
        z = journey.distance(meets) + speed * meets
        movers.append(Mover(look, -LANE + rng.uniform(-0.2, 0.2), z, -speed))
    return movers
