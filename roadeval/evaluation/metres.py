"""Masks in metres: distance bands, the ground seen from above, edges of the road, free distance.

All numbers hold for flat ground. To show how much a wrong pitch or height would change them, they
are counted again for other stances of the camera, see `STANCES`.
"""

from __future__ import annotations

import math
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from roadeval.data import CODES, NON_ROAD, ROAD, Histogram, Probability, Truth
from roadeval.data.arrays import Bits, Floats, Plane, Sums, TruthBits, pack, unpack
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.geometry.ground import OUTSIDE, Ground, Plan, pixels_of

STANCES: Final = ((0.0, 0.0), (-1.0, 0.0), (1.0, 0.0), (0.0, -0.05), (0.0, 0.05))
"""Stances of the camera, the calibrated one first: degrees further down, and metres higher."""
ABOVE: Final = "from_above"
"""Region of the ground seen from above; it counts square cells of ground, not pixels."""
UNPLACED: Final = "no_ground"
"""Region of the pixels above the horizon, or farther away than all bands."""
LEFT: Final = "left_edge"
RIGHT: Final = "right_edge"
FREE: Final = "free_distance"
"""Names of the measures of where a mask's road ends."""
STEP: Final = 0.004
"""Metres between the points of a line at which its pixels are looked up."""
MOST_POINTS: Final = 4000
"""Greatest number of points of a line."""
GAP: Final = 0.3
"""A gap in the road of fewer metres is not an edge; straight ahead the limit is `GAP_AHEAD`."""
GAP_AHEAD: Final = 0.5
LEVELS: Final = 256
"""Thresholds of KITTI's road benchmark; its confidences have eight bits."""
Pixels = npt.NDArray[np.intp]
"""``(n,)``: indices in a flattened image, or `OUTSIDE`."""


def plan_of(ground: Ground, settings: EvaluationSettings) -> Plan:
    """Return the view of the ground from above in which cells are counted."""
    return Plan(ground, *settings.plan, settings.plan_width, settings.plan_cell)


def band_name(near: int, far: int) -> str:
    """Return the name of the region from ``near`` to ``far`` metres ahead.

    >>> band_name(10, 20)
    '10-20m'
    """
    return f"{near}-{far}m"


class Survey:
    """Where the pixels of images lie on the ground, for images of the size of ``ground``.

    It is made once. It divides pixels by distance and into cells, and finds where the road ends.
    """

    def __init__(self, ground: Ground, settings: EvaluationSettings) -> None:
        self.ground = ground
        self._settings = settings
        self._shape = ground.height, ground.width
        self._grounds = [ground.moved(*stance) for stance in STANCES[: self.stances]]
        edges = [(name, at) for at in settings.edges_at for name in (LEFT, RIGHT)]
        self.measures = (*edges, (FREE, 0))
        """Name of each measure, and the distance at which it is taken."""

    @property
    def stances(self) -> int:
        """Number of `STANCES` that are counted: all if the ground has a pose, else the first."""
        return len(STANCES) if self.ground.is_posed else 1

    @cached_property
    def bands(self) -> list[dict[str, Bits]]:
        """The bands of distance for each stance, ``(H, words)`` each, by name."""
        height, width = self._shape
        columns, rows = np.meshgrid(np.arange(float(width)), np.arange(float(height)))
        rays = self.ground.rays(np.column_stack([columns.ravel(), rows.ravel()]))
        stances = []
        for ground in self._grounds:  # the lens is the same for each stance
            ahead = ground.places_of(rays)[:, 0].reshape(self._shape)
            edges = pairwise(self._settings.distances)
            bands = {(near, far): (near <= ahead) & (ahead < far) for near, far in edges}
            stances.append({band_name(*band): pack(pixels) for band, pixels in bands.items()})
        return stances

    @cached_property
    def regions(self) -> dict[str, Bits]:
        """The bands, and the pixels that lie in no band: ``(H, words)`` each, by region's name."""
        bands = self.bands[0]
        in_bands = unpack(np.bitwise_or.reduce([*bands.values()]), self._shape[1])
        return {**bands, UNPLACED: pack(in_bands == 0)}

    def levels(self, probability: Probability, truth: Truth) -> Histogram:
        """Count ground cells by truth and level: ``(2, LEVELS)`` uint32, non-road and road.

        Arguments are as in `roadeval.data.histogram`. The level of a probability is the greatest of
        KITTI's thresholds that it reaches.
        """
        pixels, cells = self._above
        labels = truth.ravel()[pixels]
        levels = probability.ravel()[pixels] // ((CODES - 1) // (LEVELS - 1))
        chosen = [labels == label for label in (NON_ROAD, ROAD)]
        counts = [np.bincount(levels[cell], cells[cell], LEVELS) for cell in chosen]
        return np.array(counts, np.uint32)

    @cached_property
    def _cells(self) -> Sums:
        """Number of ground cells in each pixel, for each stance: ``(S, H, W)``.

        A cell belongs to the pixel in which its centre lies.
        """
        height, width = self._shape
        counts = []
        for ground in self._grounds:
            cells = plan_of(ground, self._settings).cells
            counts.append(np.bincount(cells[cells != OUTSIDE], minlength=height * width))
        return np.reshape(counts, (-1, height, width))

    @cached_property
    def _above(self) -> tuple[Pixels, Floats]:
        """The pixels that have cells in the first stance, and their numbers of cells: ``(n,)``."""
        cells = self._cells[0].ravel().astype(float)
        pixels = np.flatnonzero(cells)
        return pixels, cells[pixels]

    @cached_property
    def digits(self) -> list[Bits]:
        """The binary digits of each pixel's number of cells, ``(H, words)`` each.

        The lowest digit of a stance comes first. To count the cells of some pixels, count the
        pixels that have each digit, multiply by the digit's value, and add up.
        """
        digits = range(max(1, int(self._cells.max()).bit_length()))
        return [pack((cells >> digit) & 1) for cells in self._cells for digit in digits]

    @cached_property
    def _lines(self) -> list[_Line]:
        """The lines on which the ends of the road are searched, for each stance.

        One line crosses the road at each distance; the last one runs straight ahead.
        """
        settings = self._settings
        half = settings.plan_width / 2
        across = np.linspace(half, -half, min(MOST_POINTS, round(2 * half / STEP)) | 1)
        ahead = np.geomspace(1.0, settings.distances[-1], MOST_POINTS)
        lines = []
        for ground in self._grounds:
            for at in settings.edges_at:
                places = np.column_stack([np.full_like(across, at), across])
                lines.append(self._line(ground, places, across))
            lines.append(self._line(ground, np.column_stack([ahead, 0 * ahead]), ahead))
        return lines

    def _line(self, ground: Ground, places: Floats, along: Floats) -> _Line:
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
        """Return where masks and the truth end, ``(K, S, M, 2)`` metres, see `FrameMetres.ends`.

        Across, the truth's road is the one nearest to the line straight ahead, and a mask's road
        the one nearest to the middle of the truth's. A road that leaves the picture, or meets
        pixels without truth, has no end there. Ahead, no road ends beyond the labelled pixels.
        """
        lines, places = self._lines, len(self._settings.edges_at) + 1
        crossed = np.concatenate([line.pixels for line in lines])
        stacked = np.concatenate([[truth.road, truth.labelled], masks])
        flags = np.unpackbits(
            stacked.view(np.uint8), axis=2, count=self._shape[1], bitorder="little"
        )
        taken = flags.reshape(len(flags), -1).take(crossed, axis=1)
        ends = np.cumsum([len(line.pixels) for line in lines])
        road, labelled, *mask_runs = (_runs(flags_of_lines, ends) for flags_of_lines in taken)
        found_ends = np.full((len(masks), len(lines), 2, 2), np.nan)
        for number, line in enumerate(lines):
            with_truth, borders = labelled[number], line.borders
            if number % places == places - 1:
                start, nothing, cap = 0, math.nan, math.nan
                if with_truth:
                    start, stop = _join_runs(with_truth, borders, GAP_AHEAD)[0]
                    nothing, cap = borders[start], borders[stop]
                    end = _free(road[number], start, cap, borders, math.nan)
                    found_ends[:, number, 0, 1] = end
                for place, runs in enumerate(mask_runs):
                    free = _free(runs[number], start, cap, borders, nothing)
                    found_ends[place, number, 0, 0] = free
                continue
            *sides, middle = _sides(road[number], with_truth, borders, 0.0)
            found_ends[:, number, :, 1] = sides
            line_run = [(0, len(line.pixels))]
            for place, runs in enumerate(mask_runs):
                *sides, _ = _sides(runs[number], line_run, borders, middle)
                found_ends[place, number, :, 0] = sides
        by_stance = found_ends.reshape(len(masks), self.stances, 2 * places, 2)
        return by_stance[:, :, :-1]


@lru_cache(maxsize=8)
def survey_of(ground: Ground, settings: EvaluationSettings, shape: tuple[int, int]) -> Survey:
    """Return the survey for images of ``shape`` (height, width); repeated calls share it."""
    return Survey(ground.scaled(shape[1], shape[0]), settings)


class _Line(NamedTuple):
    """A line on the ground: the pixels that it crosses, and where it enters and leaves them."""

    pixels: Pixels
    borders: list[float]
    """``(n + 1)`` metres along the line: the ends of its pixels."""


Runs = list[tuple[int, int]]
"""The first pixel of each stretch on a line, and the pixel after its last."""


def _runs(flags: Plane, ends: Sums) -> list[Runs]:
    """Return each line's stretches of set flags; ``ends`` are the positions after its last one."""
    padded = np.concatenate([[0], flags, [0]])
    changed = np.asarray(padded[1:] != padded[:-1])
    changed[ends[:-1]] = True  # a stretch ends with its line
    at = np.flatnonzero(changed)
    starts = at[:-1][flags[at[:-1]] != 0]
    stops = at[np.searchsorted(at, starts, "right")]
    firsts = np.concatenate([[0], ends[:-1]])
    lines = np.searchsorted(ends, starts, "right")
    by_line: list[Runs] = [[] for _ in ends]
    shifts = firsts[lines]
    pairs = zip(lines.tolist(), (starts - shifts).tolist(), (stops - shifts).tolist(), strict=True)
    for line, start, stop in pairs:
        by_line[line].append((start, stop))
    return by_line


def _join_runs(runs: Runs, borders: list[float], gap: float) -> Runs:
    """Join stretches with less than ``gap`` metres between them."""
    joined: Runs = []
    for start, stop in runs:
        if joined and abs(borders[start] - borders[joined[-1][1]]) < gap:
            joined[-1] = joined[-1][0], stop
        else:
            joined.append((start, stop))
    return joined


def _sides(
    runs: Runs, labelled: Runs, borders: list[float], middle: float
) -> tuple[float, float, float]:
    """Return the left end, right end and middle of the road nearest to ``middle``, in metres.

    An end beyond which nothing is labelled is NaN. Without road both ends are NaN, and
    ``middle`` is returned.
    """
    best, far = None, math.inf
    for start, stop in _join_runs(runs, borders, GAP):
        away = max(borders[stop] - middle, middle - borders[start], 0.0)
        if away < far:
            best, far = (start, stop), away
    if best is None:
        return math.nan, math.nan, middle
    start, stop = best
    return (
        borders[start] if any(first < start <= end for first, end in labelled) else math.nan,
        borders[stop] if any(first <= stop < end for first, end in labelled) else math.nan,
        (borders[start] + borders[stop]) / 2,
    )


def _free(runs: Runs, start: int, cap: float, borders: list[float], nothing: float) -> float:
    """Return the metres to the end of the road at ``start``, at most ``cap``; else ``nothing``."""
    for first, stop in _join_runs(runs, borders, GAP_AHEAD):
        if first <= start < stop:
            return min(borders[stop], cap)
    return nothing
