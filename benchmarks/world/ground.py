"""The materials of the ground: asphalt with its history, paint, soil and grass.

All textures wrap around, so that a drive may be long.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from benchmarks.world.noise import Field, coloured_noise, smoothstep
from benchmarks.world.road import HALF_WIDTH, Road, covered, paint
from benchmarks.world.texture import GroundTexture

ASPHALT: Final = np.array([0.132, 0.130, 0.126], np.float32)
PAINT: Final = np.array([0.50, 0.50, 0.475], np.float32)
SOIL: Final = np.array([0.185, 0.140, 0.098], np.float32)
GRASS: Final = np.array([0.074, 0.108, 0.034], np.float32)
DRY_GRASS: Final = np.array([0.150, 0.140, 0.060], np.float32)
"""Reflectances, red, green, blue."""

ASPHALT_CELL: Final = 0.02
VERGE_CELL: Final = 0.04
GRAIN_CELL: Final = 0.012
GRAIN_CELLS: Final = 512
ROWS: Final = 4096
ASPHALT_COLUMNS: Final = 640
VERGE_COLUMNS: Final = 1024
WHEEL_TRACKS: Final = (-2.45, -0.95, 0.95, 2.45)
"""Offsets where tyres have polished the asphalt, metres."""
SOIL_WIDTH: Final = 0.55
"""Bare soil between asphalt and grass, metres, on average."""


@dataclass(frozen=True, slots=True)
class Ground:
    """The reflectance of every point of the ground."""

    road: Road
    asphalt: GroundTexture
    verge: GroundTexture
    grain: GroundTexture

    @classmethod
    def laid(cls, road: Road, rng: np.random.Generator) -> Ground:
        """Lay a road and sow its verges."""
        half = ASPHALT_COLUMNS * ASPHALT_CELL / 2
        asphalt = GroundTexture.averaged(_asphalt(rng), ASPHALT_CELL, -half, 0.0)
        half = VERGE_COLUMNS * VERGE_CELL / 2
        verge = GroundTexture.averaged(_verge(rng), VERGE_CELL, -half, 0.0)
        grain = coloured_noise(rng, (GRAIN_CELLS, GRAIN_CELLS), 2, 20, 0.4)
        return cls(road, asphalt, verge, GroundTexture.averaged(grain, GRAIN_CELL, 0.0, 0.0))

    def reflectance(self, offset: Field, z: Field, width: Field, length: Field) -> Field:
        """Return the reflectance of patches of ground.

        Parameters
        ----------
        offset, z
            ``(h, w)`` centres of the patches, metres.
        width, length
            ``(h,)`` extent of each row's patches across and along the road, metres.

        Returns
        -------
        ndarray
            ``(h, w, 3)`` float32.
        """
        wear = self.asphalt.sample(offset, z, length)
        grain = self.grain.sample(offset, z, length)
        left, right = self.road.edges(z)
        frayed = np.float32(0.05) * np.sin(5.1 * z + 2 * np.sin(1.7 * z))
        paved = covered(offset, width[:, None] + 0.03, left + frayed, right + frayed)
        painted = paint(offset, z, width[:, None], length[:, None])
        painted *= smoothstep(wear, 0.35, 0.85)
        wear *= np.exp(np.float32(0.06) * grain)
        road = wear[..., None] * (ASPHALT + painted[..., None] * (PAINT - ASPHALT))
        verge = self.verge.sample(offset, z, length)
        verge *= np.exp(np.float32(0.28) * grain)[..., None]
        return np.asarray(verge + paved[..., None] * (road - verge))


def _asphalt(rng: np.random.Generator) -> Field:
    """``(rows, columns)`` brightness of asphalt about 1: grain, tyre tracks, repairs, cracks."""
    shape = (ROWS, ASPHALT_COLUMNS)
    blotches = coloured_noise(rng, (ROWS // 8, ASPHALT_COLUMNS // 8), 2, 64, 0.9)
    cloudy = cv2.resize(blotches, shape[::-1], interpolation=cv2.INTER_CUBIC)
    grain = coloured_noise(rng, shape, 2, 6, 0.3)
    offset = (np.arange(ASPHALT_COLUMNS) + 0.5) * ASPHALT_CELL - ASPHALT_COLUMNS * ASPHALT_CELL / 2
    worn = sum(np.exp(-(((offset - track) / 0.33) ** 2)) for track in WHEEL_TRACKS)
    oily = sum(np.exp(-(((offset - lane) / 0.3) ** 2)) for lane in (-1.7, 1.7))
    surface = np.exp(0.05 * cloudy + 0.07 * grain + (0.07 * worn - 0.09 * oily)[None, :])
    surface = np.asarray(surface, np.float32)
    _repair(surface, rng)
    _crack(surface, rng)
    return surface


def _repair(surface: Field, rng: np.random.Generator) -> None:
    """Cut patches and a long trench into the asphalt and fill them with another mixture."""
    for _ in range(7):
        rows, columns = rng.integers((60, 40), (420, 130))
        top, left = rng.integers(0, np.subtract(surface.shape, (rows, columns)))
        surface[top : top + rows, left : left + columns] *= rng.uniform(0.74, 1.10)
        low = (int(left + columns), int(top + rows))
        seam = np.ones_like(surface)
        cv2.rectangle(seam, (int(left), int(top)), low, 0.7, 2)
        surface *= seam


def _crack(surface: Field, rng: np.random.Generator) -> None:
    """Draw cracks: random walks along or across the road, dark and thin."""
    for _ in range(26):
        steps = int(rng.integers(8, 40))
        heading = np.pi / 2 * rng.integers(0, 2) + np.cumsum(rng.normal(0.0, 0.35, steps))
        walk = np.cumsum(12.0 * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
        walk += rng.uniform((100, 0), surface.shape[::-1])
        dark = float(rng.uniform(0.45, 0.75))
        cv2.polylines(surface, [walk.round().astype(np.int32)], False, dark, 1)


def _verge(rng: np.random.Generator) -> Field:
    """``(rows, columns, 3)`` reflectance beside the asphalt: soil that passes into grass."""
    shape = (ROWS // 2, VERGE_COLUMNS)
    patches = cv2.resize(
        coloured_noise(rng, (ROWS // 16, VERGE_COLUMNS // 8), 2, 60, 1.0), shape[::-1]
    )
    tufts = coloured_noise(rng, shape, 2, 16, 0.5)
    columns = (np.arange(VERGE_COLUMNS) + 0.5) * VERGE_CELL - VERGE_COLUMNS * VERGE_CELL / 2
    beyond = np.abs(columns)[None, :] - HALF_WIDTH - SOIL_WIDTH
    grown = smoothstep(np.asarray(beyond + 0.30 * patches + 0.12 * tufts, np.float32), -0.2, 0.25)
    bald = smoothstep(patches + 0.3 * tufts, 1.6, 2.1)
    dry = smoothstep(0.8 * patches[::-1] + 0.4 * tufts, 0.2, 2.2)[..., None]
    grass = (GRASS + dry * (DRY_GRASS - GRASS)) * np.exp(0.33 * tufts)[..., None]
    soil = SOIL * np.exp(0.12 * patches + 0.16 * tufts)[..., None]
    mixed = soil + (grown * (1 - 0.8 * bald))[..., None] * (grass - soil)
    return np.asarray(mixed, np.float32)
