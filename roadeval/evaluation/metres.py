"""Masks in metres: distance bands, the ground seen from above, edges of the road, free distance.

All of it holds for flat ground. How far a wrong pitch or height would move a number is counted by
counting again as if the camera stood otherwise, see `STANCES`.
"""

from __future__ import annotations

import math
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from roadeval.data import CODES, NON_ROAD, ROAD, Histogram, Probability, Truth
from roadeval.data.arrays import Bits, Floats, Matrix, Plane, Sums, TruthBits, pack, unpack
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.geometry.ground import Ground
from roadeval.geometry.plan import OUTSIDE, Plan, pixels_of

STANCES: Final = ((0.0, 0.0), (-1.0, 0.0), (1.0, 0.0), (0.0, -0.05), (0.0, 0.05))
"""As the camera is said to stand, and as it might: degrees further down, and metres higher."""
ABOVE: Final = "from_above"
"""The region of the ground seen from above: it counts square cells of ground, not pixels."""
UNPLACED: Final = "no_ground"
"""The region of the pixels above the horizon, or farther away than all bands."""
LEFT: Final = "left_edge"
RIGHT: Final = "right_edge"
FREE: Final = "free_distance"
"""The measures of a mask's ends."""
STEP: Final = 0.004
"""Metres between the places of a line that are looked up, to find the pixels that it crosses."""
FARTHEST: Final = 4000
"""Places of a line at most."""
GAP: Final = 0.3
"""A gap in the road of fewer metres across is no edge; ahead of fewer than `GAP_AHEAD`."""
GAP_AHEAD: Final = 0.5
LEVELS: Final = 256
"""Thresholds of KITTI's road benchmark, whose confidences have eight bits."""
Pixels = npt.NDArray[np.intp]
"""``(n,)``: places in a flat image; `OUTSIDE` of none."""


def plan_of(ground: Ground, settings: EvaluationSettings) -> Plan:
    """Return the ground seen from above whose cells are counted."""
    return Plan(ground, *settings.plan, settings.plan_width, settings.plan_cell)


def band_name(near: int, far: int) -> str:
    """Return the name of a band of distance, as a region.

    >>> band_name(10, 20)
    '10-20m'
    """
    return f"{near}-{far}m"


class Survey:
    """The places on the ground of an image's pixels, for images of the size of ``ground``.

    Made once, it counts masks by distance and from above, and finds where the road ends.
    """

    def __init__(self, ground: Ground, settings: EvaluationSettings) -> None:
        self.ground = ground
        self._settings = settings
        self._shape = ground.height, ground.width
        self._grounds = [ground.moved(*each) for each in STANCES[: self.stances]]
        edges = [(name, at) for at in settings.edges_at for name in (LEFT, RIGHT)]
        self.measures = (*edges, (FREE, 0))
        """The name of each measure, and the distance at which it is taken."""

    @property
    def stances(self) -> int:
        """How many of `STANCES` are counted: the first alone where a homography is all there is."""
        return len(STANCES) if self.ground.is_posed else 1

    @cached_property
    def bands(self) -> list[dict[str, Bits]]:
        """The bands of distance for each stance, ``(H, words)`` each, by name."""
        height, width = self._shape
        columns, rows = np.meshgrid(np.arange(float(width)), np.arange(float(height)))
        rays = self.ground.rays(np.column_stack([columns.ravel(), rows.ravel()]))
        found = []
        for ground in self._grounds:  # the lens is the same, however the camera stands
            ahead = ground.places_of(rays)[:, 0].reshape(self._shape)
            found.append(
                {
                    band_name(near, far): pack((near <= ahead) & (ahead < far))
                    for near, far in pairwise(self._settings.distances)
                }
            )
        return found

    @cached_property
    def regions(self) -> dict[str, Bits]:
        """The regions of the frame that it counts: the bands, and what lies in none."""
        bands = self.bands[0]
        placed = unpack(np.bitwise_or.reduce([*bands.values()]), self._shape[1])
        return {**bands, UNPLACED: pack(placed == 0)}

    def levels(self, probability: Probability, truth: Truth) -> Histogram:
        """Count cells of the ground seen from above: ``(2, LEVELS)`` uint32, non-road and road.

        Arguments are as of `roadeval.data.histogram`; a level is the greatest of KITTI's thresholds
        that a probability reaches.
        """
        pixels, cells = self._above
        codes, labels = (each.ravel()[pixels] for each in (probability, truth))
        levels = codes // ((CODES - 1) // (LEVELS - 1))
        counts = [
            np.bincount(levels[labels == each], cells[labels == each], LEVELS)
            for each in (NON_ROAD, ROAD)
        ]
        return np.array(counts, np.uint32)

    @cached_property
    def _cells(self) -> Sums:
        """How many cells of the ground seen from above each pixel stands for, ``(S, H, W)``.

        A cell takes the pixel in which its centre lies.
        """
        height, width = self._shape
        counts = []
        for ground in self._grounds:
            cells = plan_of(ground, self._settings).cells
            counts.append(np.bincount(cells[cells != OUTSIDE], minlength=height * width))
        return np.reshape(counts, (-1, height, width))

    @cached_property
    def _above(self) -> tuple[Pixels, Floats]:
        """The pixels seen from above as the camera is said to stand, and the cells of each."""
        cells = self._cells[0].ravel().astype(float)
        pixels = np.flatnonzero(cells)
        return pixels, cells[pixels]

    @cached_property
    def digits(self) -> list[Bits]:
        """The binary digits of how many cells each pixel stands for, ``(H, words)`` each.

        The least digit of a stance is its first. Pixels counted in each digit, times the digit's
        worth, are the cells.
        """
        digits = range(max(1, int(self._cells.max()).bit_length()))
        return [pack((cells >> digit) & 1) for cells in self._cells for digit in digits]

    @cached_property
    def _lines(self) -> list[_Line]:
        """The lines along which a road's ends are looked for: of each stance one a measure's place.

        They lie across at each distance, and straight ahead.
        """
        settings = self._settings
        half = settings.plan_width / 2
        across = np.linspace(half, -half, min(FARTHEST, round(2 * half / STEP)) | 1)
        ahead = np.geomspace(1.0, settings.distances[-1], FARTHEST)
        lines = []
        for ground in self._grounds:
            for at in settings.edges_at:
                places = np.column_stack([np.full_like(across, at), across])
                lines.append(self._line(ground, places, across))
            lines.append(self._line(ground, np.column_stack([ahead, 0 * ahead]), ahead))
        return lines

    def _line(self, ground: Ground, places: Matrix, along: Floats) -> _Line:
        seen = pixels_of(ground, places)
        inside: Pixels = np.flatnonzero(seen != OUTSIDE)
        if not len(inside):
            return _Line(np.zeros(0, np.intp), [0.0])
        part = slice(inside[0], inside[-1] + 1)
        seen, along = seen[part], along[part]
        steps = np.flatnonzero(np.diff(seen)) + 1
        borders = np.concatenate([along[:1], (along[steps - 1] + along[steps]) / 2, along[-1:]])
        return _Line(seen[np.concatenate([[0], steps])], borders.tolist())

    def ends(self, masks: Bits, truth: TruthBits) -> Floats:
        """Return where masks and the truth end, ``(K, S, M, 2)``, see `FrameMetres.ends`.

        Across, the truth's road is the one nearest to the line straight ahead, and a mask's the one
        nearest to the middle of that; what runs out of the picture, or into pixels without truth,
        has no end there. Ahead, both end at the latest where the truth is no longer known.
        """
        lines, places = self._lines, len(self._settings.edges_at) + 1
        crossed = np.concatenate([line.pixels for line in lines])
        stacked = np.concatenate([[truth.road, truth.labelled], masks])
        flags = np.unpackbits(
            stacked.view(np.uint8), axis=2, count=self._shape[1], bitorder="little"
        )
        taken = flags.reshape(len(flags), -1).take(crossed, axis=1)
        ends = np.cumsum([len(line.pixels) for line in lines])
        road, labelled, *own = (_runs(each, ends) for each in taken)
        found = np.full((len(own), len(lines), 2, 2), np.nan)
        for number, line in enumerate(lines):
            known, borders = labelled[number], line.borders
            if number % places == places - 1:
                end, start, cap = _ahead(road[number], known, borders)
                found[:, number, 0, 1] = end
                nothing = borders[start] if known else math.nan
                for place, runs in enumerate(own):
                    found[place, number, 0, 0] = _free(runs[number], start, cap, borders, nothing)
                continue
            *sides, middle = _sides(road[number], known, borders, 0.0)
            found[:, number, :, 1] = sides
            whole = [(0, len(line.pixels))]
            for place, runs in enumerate(own):
                found[place, number, :, 0] = _sides(runs[number], whole, borders, middle)[:2]
        by_stance = found.reshape(len(own), self.stances, 2 * places, 2)
        return by_stance[:, :, :-1]


@lru_cache(maxsize=8)
def survey_of(ground: Ground, settings: EvaluationSettings, shape: tuple[int, int]) -> Survey:
    """Return the survey for images of ``shape``, height and width: made once."""
    return Survey(ground.scaled(shape[1], shape[0]), settings)


class _Line(NamedTuple):
    """A line on the ground: the pixels that it crosses, and where it enters and leaves them."""

    pixels: Pixels
    borders: list[float]
    """Metres, one more than pixels."""


Runs = list[tuple[int, int]]
"""The first pixel of each stretch on a line, and the one after its last."""


def _runs(flags: Plane, ends: Sums) -> list[Runs]:
    """Return the stretches of pixels that are set, line by line; ``ends`` are the lines' ends."""
    padded = np.concatenate([[0], flags, [0]])
    changed = np.asarray(padded[1:] != padded[:-1])
    changed[ends[:-1]] = True  # a stretch ends with its line
    at = np.flatnonzero(changed)
    starts = at[:-1][flags[at[:-1]] != 0]
    stops = at[np.searchsorted(at, starts, "right")]
    firsts = np.concatenate([[0], ends[:-1]])
    lines = np.searchsorted(ends, starts, "right")
    found: list[Runs] = [[] for _ in ends]
    shifts = firsts[lines]
    pairs = zip(lines.tolist(), (starts - shifts).tolist(), (stops - shifts).tolist(), strict=True)
    for line, start, stop in pairs:
        found[line].append((start, stop))
    return found


def _joined(runs: Runs, borders: list[float], gap: float) -> Runs:
    """Join stretches with less than ``gap`` metres between them."""
    joined: Runs = []
    for start, stop in runs:
        if joined and abs(borders[start] - borders[joined[-1][1]]) < gap:
            joined[-1] = joined[-1][0], stop
        else:
            joined.append((start, stop))
    return joined


def _sides(
    runs: Runs, known: Runs, borders: list[float], middle: float
) -> tuple[float, float, float]:
    """Return the left and the right end of the road nearest to a place, and its middle, in metres.

    An end beyond which nothing is known is NaN. Without road all three are, but for the middle.
    """
    best, far = None, math.inf
    for start, stop in _joined(runs, borders, GAP):
        away = max(borders[stop] - middle, middle - borders[start], 0.0)
        if away < far:
            best, far = (start, stop), away
    if best is None:
        return math.nan, math.nan, middle
    start, stop = best
    return (
        borders[start] if any(first < start <= end for first, end in known) else math.nan,
        borders[stop] if any(first <= stop < end for first, end in known) else math.nan,
        (borders[start] + borders[stop]) / 2,
    )


def _ahead(road: Runs, known: Runs, borders: list[float]) -> tuple[float, int, float]:
    """Return where the truth's road ahead ends, its first pixel, and how far it is known.

    The ends are in metres; the road's is NaN where there is none at the begin.
    """
    if not known:
        return math.nan, 0, math.nan
    start, stop = _joined(known, borders, GAP_AHEAD)[0]
    return _free(road, start, borders[stop], borders, math.nan), start, borders[stop]


def _free(runs: Runs, start: int, cap: float, borders: list[float], nothing: float) -> float:
    """Return how far the road reaches from a pixel on, in metres, at most to ``cap``."""
    for first, stop in _joined(runs, borders, GAP_AHEAD):
        if first <= start < stop:
            return min(borders[stop], cap)
    return nothing
