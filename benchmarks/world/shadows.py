"""Cast shadows: the things beside the road, projected along the sun's rays.

Occluders are cut into layers by height. A layer's silhouette, projected along the sun onto the
ground, is blurred by the sun's disc as it appears from there: the penumbra grows with the way
from occluder to ground. The share of the sun seen from a point is the product over the layers
above it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.world.light import SUN_RADIUS, Sun
from benchmarks.world.noise import Field
from benchmarks.world.road import Road
from benchmarks.world.texture import GroundTexture
from roadeval.data.arrays import Floats

CELL: Final = 0.04
"""Side of a map cell, metres: about the penumbra's radius at ten metres."""
REACH: Final = 18.0
"""The maps cover offsets up to this, metres to either side."""
HEIGHTS: Final = (0.0, 1.0, 2.5, 4.0, 5.5, 7.0, 9.0, 14.0)
"""Bounds of the layers, metres."""
LEAF_CELLS: Final = 3
"""A cluster of leaves covers a disc of this many cells: 12 cm."""
SKY_HIDDEN: Final = 0.45
"""Share of the sky that a dense canopy hides from the ground below."""
SKY_BLUR: Final = 2.0
"""Radius over which the hidden sky changes, metres."""

Silhouette = npt.NDArray[np.uint8]


def disc_of_the_sun(sun: Sun, height: float) -> Field:
    """Image of the sun's disc that a pinhole at ``height`` casts on the ground, in map cells.

    Its radius across the rays is the way times the sun's angular radius; along the ground it is
    longer by ``1 / sin(elevation)``.

    Returns
    -------
    ndarray
        ``(k, k)`` float32 with sum 1, k odd.
    """
    across = height / np.sin(sun.elevation) * np.tan(SUN_RADIUS) / CELL
    along = across / np.sin(sun.elevation)
    half = int(np.ceil(along))
    fine = (np.arange((2 * half + 1) * 8) + 0.5) / 8 - half - 0.5
    x, z = np.meshgrid(fine, fine)
    away = x * np.sin(sun.azimuth) + z * np.cos(sun.azimuth)
    aside = x * np.cos(sun.azimuth) - z * np.sin(sun.azimuth)
    inside = (away / max(along, 0.1)) ** 2 + (aside / max(across, 0.1)) ** 2 <= 1.0
    cells = inside.reshape(2 * half + 1, 8, 2 * half + 1, 8).mean((1, 3))
    return np.asarray(cells / cells.sum(), np.float32)


class Silhouettes:
    """Collects the things between the sun and a stretch of road, layer by layer."""

    def __init__(self, road: Road, sun: Sun, start: float, end: float) -> None:
        self.road, self.sun, self.start = road, sun, start
        shape = (round((end - start) / CELL), round(2 * REACH / CELL))
        layers = len(HEIGHTS) - 1
        self._solid = [np.zeros(shape, np.uint8) for _ in range(layers)]
        self._leaves = [np.zeros(shape, np.uint8) for _ in range(layers)]

    def add_leaves(self, points: Floats) -> None:
        """Add clusters of leaves, ``(n, 3)`` metres."""
        cells = np.floor(self._cells(points)).astype(np.int64)
        rows, columns = self._solid[0].shape
        on_map = ((cells >= 0) & (cells < (columns, rows))).all(1)
        layer = np.searchsorted(HEIGHTS, points[:, 1], "right") - 1
        for k, leaves in enumerate(self._leaves):
            column, row = cells[on_map & (layer == k)].T
            leaves[row, column] = 255

    def add_rods(self, feet: Floats, tips: Floats, radii: Floats) -> None:
        """Add straight trunks, branches or poles.

        ``feet`` and ``tips`` are ``(n, 3)``, ``radii`` ``(n,)``, all in metres. Each is cut into
        pieces of half a metre at most, and a piece is drawn into the layer of its mean height.
        """
        ways = tips - feet
        pieces = np.ceil(np.linalg.norm(ways, axis=1) / 0.5).astype(int).clip(1)
        rod = np.repeat(np.arange(len(feet)), pieces + 1)
        along = np.concatenate([np.linspace(0.0, 1.0, count + 1) for count in pieces.tolist()])
        ends = feet[rod] + along[:, None] * ways[rod]
        corners = np.round(self._cells(ends) * 16 - 8).astype(int)
        begins = np.flatnonzero(rod[1:] == rod[:-1])
        layers = self._layers((ends[begins, 1] + ends[begins + 1, 1]) / 2)
        widths = np.round(2 * radii / CELL).astype(int).clip(1)[rod[begins]]
        for a, b, layer, width in zip(
            corners[begins].tolist(),
            corners[begins + 1].tolist(),
            layers.tolist(),
            widths.tolist(),
            strict=True,
        ):
            cv2.line(self._solid[layer], a, b, 255, width, cv2.LINE_8, 4)

    def add_box(self, low: Floats, high: Floats) -> None:
        """Add an upright box between two opposite corners, ``(3,)`` metres each."""
        for k, (floor, ceiling) in enumerate(pairwise(HEIGHTS)):
            bottom, top = max(low[1], floor), min(high[1], ceiling)
            if bottom < top:
                corners = np.array(
                    [(x, y, z) for x in (low[0], high[0]) for y in (bottom, top)
                     for z in (low[2], high[2])]
                )  # fmt: skip
                outline = cv2.convexHull(self._cells(corners).astype(np.float32))
                fixed = np.round(outline * 16 - 8).astype(np.int32)
                cv2.fillConvexPoly(self._solid[k], fixed, 255, cv2.LINE_8, 4)

    def cast(self) -> SunMap:
        """Blur every layer by the sun's disc and multiply the shares that remain."""
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (LEAF_CELLS, LEAF_CELLS))
        visible = []
        for k, (solid, leaves) in enumerate(zip(self._solid, self._leaves, strict=True)):
            blocked = cv2.max(solid, cv2.dilate(leaves, disc))
            height = (HEIGHTS[k] + HEIGHTS[k + 1]) / 2
            visible.append(255 - cv2.filter2D(blocked, -1, disc_of_the_sun(self.sun, height)))
        return SunMap(self.road, self.sun, self.start, tuple(visible))

    def _cells(self, points: Floats) -> Floats:
        """``(n, 2)`` column and row, in cells from the map's outer corner, of points' shadows."""
        return to_cells(self.road, self.start, self.sun.shadow_of(points))

    def _layers(self, heights: Floats) -> npt.NDArray[np.intp]:
        """``(n,)`` numbers of the layers that ``(n,)`` heights lie in."""
        return np.searchsorted(HEIGHTS, heights, "right").clip(1, len(HEIGHTS) - 1) - 1


def to_cells(road: Road, start: float, ground: Floats) -> Floats:
    """Columns and rows of ``(n, 2)`` ground X and Z, in cells from the map's outer corner."""
    offset = ground[:, 0] - road.centre(ground[:, 1])
    return np.stack([(offset + REACH) / CELL, (ground[:, 1] - start) / CELL], axis=1)


@dataclass(frozen=True)
class SunMap:
    """The share of the sun's disc seen from any point near the road.

    ``layers`` are ``(rows, columns)`` uint8, the share of 255 that each layer of `HEIGHTS` lets
    through to the ground.
    """

    road: Road
    sun: Sun
    start: float
    layers: tuple[Silhouette, ...]

    def ground(self) -> GroundTexture:
        """Return the share of the sun seen from the ground, float32 0..1, ready to sample."""
        share = np.ones(self.layers[0].shape, np.float32)
        for layer in self.layers:
            share *= layer * np.float32(1 / 255)
        return GroundTexture.averaged(share, CELL, -REACH, self.start, outside=1.0)

    def hidden_sky(self, ground: GroundTexture) -> GroundTexture:
        """Return the share of the sky hidden from the ground: large where shade is dense.

        This is an approximation: a thing before the sun also hides the sky about it.
        """
        coarse = 1.0 - cv2.resize(ground.levels[0], None, fx=1 / 8, fy=1 / 8,
                                  interpolation=cv2.INTER_AREA)  # fmt: skip
        hidden = SKY_HIDDEN * cv2.GaussianBlur(coarse, (0, 0), SKY_BLUR / (8 * CELL))
        return GroundTexture.averaged(hidden, 8 * CELL, -REACH, self.start, outside=0.0)

    def visible_from(self, points: Floats) -> Field:
        """``(h, w)`` share of the sun's disc seen from ``(h, w, 3)`` points.

        Only the layers wholly above a point count, so that no wall stands in its own way.
        """
        ground = self.sun.shadow_of(points.reshape(-1, 3))
        cells = to_cells(self.road, self.start, ground) - 0.5
        column, row = cells.astype(np.float32).T.reshape(2, *points.shape[:2])
        share = np.ones(points.shape[:2], np.float32)
        for layer, bottom in zip(self.layers, HEIGHTS[:-1], strict=True):
            light = cv2.remap(
                layer, column, row, cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_CONSTANT, borderValue=255,
            )  # fmt: skip
            share *= np.where(points[..., 1] <= bottom, light / np.float32(255), 1.0)
        return share
