"""How the vehicle goes, and through which light: speed, swaying, and the cloud that passes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from benchmarks.world.camera import Pose
from benchmarks.world.light import THICK
from benchmarks.world.road import Road

SPEED: Final = 12.5
"""Metres a second: 45 km/h."""
CAMERA_HEIGHT: Final = 1.42
LANE: Final = 1.7
"""Offset of the lane's middle: traffic keeps to the right."""
PITCH: Final = np.radians(-2.9)
CLOUD_EDGE: Final = 0.7
"""Seconds that the edge of the cloud takes to pass."""
CAST_RAMP: Final = 0.18
"""How far the beam has risen when the stretch without shadow ends: to about `CASTING_BEAM`."""


class Stretch(StrEnum):
    """How much shadow lies on a stretch of road."""

    MODERATE = "moderate"
    NONE = "none"
    HEAVY = "heavy"


@dataclass(frozen=True, slots=True)
class Sway:
    """A slow wave: ``amplitude * sin(2 pi t / period + phase)``."""

    amplitude: float
    period: float
    phase: float

    def at(self, time: float) -> float:
        """Return the deflection at ``time`` seconds."""
        return float(self.amplitude * np.sin(2 * np.pi * time / self.period + self.phase))


@dataclass(frozen=True, slots=True)
class Journey:
    """A drive of ``duration`` seconds in three equal stretches, the first one moderate.

    No shadow falls while a cloud hides the sun; otherwise the things beside the road cast it.
    """

    duration: float
    stretches: tuple[Stretch, Stretch, Stretch]
    lateral: tuple[Sway, ...]
    yaw: tuple[Sway, ...]
    pitch: tuple[Sway, ...]
    roll: tuple[Sway, ...]

    @classmethod
    def draw(cls, duration: float, rng: np.random.Generator) -> Journey:
        """Draw the order of the last two stretches, and every sway."""
        last = rng.permutation([Stretch.NONE, Stretch.HEAVY])

        def sways(*waves: tuple[float, float]) -> tuple[Sway, ...]:
            return tuple(
                Sway(a * rng.uniform(0.7, 1.2), p * rng.uniform(0.8, 1.25), rng.uniform(0, 6.28))
                for a, p in waves
            )

        return cls(
            duration,
            (Stretch.MODERATE, Stretch(last[0]), Stretch(last[1])),
            lateral=sways((0.45, 7.0), (0.08, 2.2)),
            yaw=sways((np.radians(1.3), 4.6), (np.radians(0.15), 0.9)),
            pitch=sways((np.radians(0.9), 6.2), (np.radians(0.16), 0.7)),
            roll=sways((np.radians(0.5), 3.7)),
        )

    def stretch(self, time: float) -> Stretch:
        """Return the stretch at ``time`` seconds, 0 to ``duration``."""
        return self.stretches[min(2, int(3 * time / self.duration))]

    def extent(self, stretch: Stretch) -> tuple[float, float]:
        """Z at which the vehicle enters and leaves a stretch, metres."""
        third = self.stretches.index(stretch)
        return (
            self.distance(third * self.duration / 3),
            self.distance((third + 1) * self.duration / 3),
        )

    def distance(self, time: float) -> float:
        """Z of the vehicle at ``time`` seconds, metres."""
        return SPEED * time

    def pose(self, time: float, road: Road) -> Pose:
        """Return the camera's pose at ``time`` seconds."""
        z = np.array([self.distance(time)])
        sideways = sum(sway.at(time) for sway in self.lateral)
        x = float(road.centre(z)[0]) + LANE + sideways
        yaw, pitch, roll = (
            sum(sway.at(time) for sway in sways) for sways in (self.yaw, self.pitch, self.roll)
        )
        heading = float(np.arctan(road.slope(z)[0]))
        return Pose(x, CAMERA_HEIGHT, float(z[0]), heading + yaw, PITCH + pitch, roll)

    def beam(self, time: float) -> float:
        """Share of the direct sun that gets past the cloud at ``time`` seconds."""
        third = self.duration / 3
        begin = self.stretches.index(Stretch.NONE) * third
        edge = min(CLOUD_EDGE, third / 4)
        outside = max(begin - time, time - (begin + third)) / edge
        if begin + third >= self.duration:
            outside = (begin - time) / edge
        ramp = float(np.clip(outside + CAST_RAMP, 0.0, 1.0))
        return THICK + (1 - THICK) * ramp * ramp * (3 - 2 * ramp)
