"""The road as geometry: its centre line, its edges, its paint.

World axes: X right, Y up, Z forward, in metres; the road lies in the plane Y = 0 and runs along
Z. A point is also told by its *offset*: X minus the centre line's X at the same Z, positive to
the right. Maps of the ground are kept in offset and Z, where the road is straight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.world.noise import Field
from roadeval.data.arrays import Flags

HALF_WIDTH: Final = 3.4
"""From the centre line to the edge of the asphalt, metres: two narrow suburban lanes."""
BAY_DEPTH: Final = 2.3
"""How much further the asphalt reaches to the right in a lay-by, metres."""
BAY_TAPER: Final = 9.0
"""Over how many metres of road a lay-by opens and closes."""

DASH_LENGTH: Final = 3.0
DASH_PERIOD: Final = 9.0
CENTRE_LINE_WIDTH: Final = 0.14
EDGE_LINE_WIDTH: Final = 0.11
EDGE_LINE_INSET: Final = 0.28
"""From the asphalt's edge (without lay-bys) to the middle of the edge line, metres."""


@dataclass(frozen=True, slots=True)
class Bend:
    """One swing of the centre line: ``amplitude * sin(2 pi Z / wavelength + phase)``, metres."""

    amplitude: float
    wavelength: float
    phase: float


@dataclass(frozen=True, slots=True)
class Road:
    """A two-lane road: gentle bends, and a lay-by on the right from ``bay[0]`` to ``bay[1]``."""

    bends: tuple[Bend, ...]
    bay: tuple[float, float]

    def centre(self, z: Field) -> Field:
        """X of the centre line at ``z``."""
        parts = [b.amplitude * np.sin(2 * np.pi / b.wavelength * z + b.phase) for b in self.bends]
        return np.asarray(sum(parts, np.zeros_like(z)), z.dtype)

    def slope(self, z: Field) -> Field:
        """Return dX/dZ of the centre line at ``z``: the tangent of the road's heading."""
        parts = [
            b.amplitude * 2 * np.pi / b.wavelength * np.cos(2 * np.pi / b.wavelength * z + b.phase)
            for b in self.bends
        ]
        return np.asarray(sum(parts, np.zeros_like(z)), z.dtype)

    def edges(self, z: Field) -> tuple[Field, Field]:
        """Offsets of the asphalt's left and right edge at ``z``."""
        widening = 1.0 / np.cos(np.arctan(self.slope(z)))
        begin, end = self.bay
        inside = np.minimum(z - begin, end - z) / BAY_TAPER
        bay = BAY_DEPTH * np.clip(inside, 0.0, 1.0)
        return -HALF_WIDTH * widening, (HALF_WIDTH + bay) * widening

    def is_road(self, offset: Field, z: Field) -> Flags:
        """Return which points of the ground are road: bool, shaped like ``offset``."""
        left, right = self.edges(z)
        return np.asarray((offset >= left) & (offset <= right))


def covered(x: Field, width: Field, low: Field | float, high: Field | float) -> Field:
    """Share of an interval of ``width`` about ``x`` that lies between ``low`` and ``high``."""
    overlap = np.minimum(x + width / 2, high) - np.maximum(x - width / 2, low)
    return np.asarray(np.clip(overlap / width, 0.0, 1.0), np.float32)


def dashed(z: Field, length: Field) -> Field:
    """Share of an interval of ``length`` about ``z`` that dashes cover, along their line."""

    def painted_up_to(end: Field) -> Field:
        dashes, rest = np.divmod(end, DASH_PERIOD)
        return np.asarray(dashes * DASH_LENGTH + np.minimum(rest, DASH_LENGTH), end.dtype)

    painted = painted_up_to(z + length / 2) - painted_up_to(z - length / 2)
    return np.asarray(painted / length, np.float32)


def paint(offset: Field, z: Field, width: Field, length: Field) -> Field:
    """Share of a patch of ground that lane markings cover, exact for patches along the road.

    Parameters
    ----------
    offset, z
        Centres of the patches, metres.
    width, length
        Extent of the patches across and along the road, metres.
    """
    centre = covered(offset, width, -CENTRE_LINE_WIDTH / 2, CENTRE_LINE_WIDTH / 2)
    line = HALF_WIDTH - EDGE_LINE_INSET
    low, high = line - EDGE_LINE_WIDTH / 2, line + EDGE_LINE_WIDTH / 2
    edges = covered(np.abs(offset), width, low, high)
    return centre * dashed(z, length) + edges
