"""The place: sun, road, ground, and all that stands beside it, with the shadows it casts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.world.ground import Ground
from benchmarks.world.journey import Journey
from benchmarks.world.light import Sun
from benchmarks.world.panel import Panel
from benchmarks.world.road import Bend, Road
from benchmarks.world.roadside import BEHIND, Roadside
from benchmarks.world.shadows import Silhouettes, SunMap
from benchmarks.world.sky import Sky
from benchmarks.world.texture import GroundTexture
from roadeval.data.arrays import Floats

SHADED_AHEAD: Final = 110.0
"""Shadows lie on the ground up to this far beyond the end of the drive, metres."""
BAY_LENGTH: Final = 42.0
"""Length of the lay-by with its tapers, metres."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """All that does not move.

    Parameters
    ----------
    sun, road, ground, sky
        What they say.
    shade
        The share of the sun's disc that is seen from above the ground.
    sunlight
        The same seen from the ground itself.
    hidden_sky
        The share of the sky that is not seen from the ground.
    panels
        Everything that stands.
    corners
        ``(n, 4, 3)`` metres: the corners of the panels.
    """

    sun: Sun
    road: Road
    ground: Ground
    sky: Sky
    shade: SunMap
    sunlight: GroundTexture
    hidden_sky: GroundTexture
    panels: tuple[Panel, ...]
    corners: Floats


def build(journey: Journey, rng: np.random.Generator) -> Scene:
    """Build a scene for a journey: choose sun and road, set things up, cast their shadows."""
    side = float(rng.choice([-1.0, 1.0]))
    sun = Sun(np.radians(rng.uniform(36, 46)), side * np.radians(rng.uniform(62, 105)))
    end = journey.distance(journey.duration)
    road = _road(end, rng)
    roadside = Roadside(journey, road, sun, rng)
    houses = list(roadside.houses())
    things = list(roadside.clear_of(houses))
    silhouettes = Silhouettes(road, sun, -BEHIND, end + SHADED_AHEAD)
    for house in houses:
        house.occlude(silhouettes)
    for thing in things:
        thing.occlude(silhouettes)
    shade = silhouettes.cast()
    panels = [thing.panel(shade) for thing in things]
    panels += [panel for house in houses for panel in house.panels(shade, rng)]
    sunlight = shade.ground()
    return Scene(
        sun,
        road,
        Ground.laid(road, rng),
        Sky.painted(sun, rng),
        shade,
        sunlight,
        shade.hidden_sky(sunlight),
        tuple(panels),
        np.stack([panel.corners() for panel in panels]),
    )


def _road(end: float, rng: np.random.Generator) -> Road:
    """Draw a winding road with a lay-by somewhere along the drive."""
    bends = (
        Bend(rng.uniform(6.0, 8.5), rng.uniform(200, 260), rng.uniform(0, 2 * np.pi)),
        Bend(rng.uniform(0.5, 0.9), rng.uniform(80, 110), rng.uniform(0, 2 * np.pi)),
    )
    begin = float(rng.uniform(0.35, 0.75) * end)
    return Road(bends, (begin, begin + BAY_LENGTH))
