"""Charts as data, for a page that draws them itself and shows the values under the pointer.

A figure that is a picture may carry the same content as charts: see `roadeval.report.blocks`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

import numpy as np
import numpy.typing as npt

POINTS: Final = 1500
"""Points of a series along the drive, at most: more do not fit beside each other on a screen."""


class ChartKind(StrEnum):
    """How numbers are drawn: lines from left to right, bars, points, marks in rows, or a map."""

    LINES = "lines"
    BARS = "bars"
    POINTS = "points"
    MARKS = "marks"
    MAP = "map"


@dataclass(frozen=True, slots=True)
class Series:
    """Numbers of one colour.

    Parameters
    ----------
    name
        For the legend.
    colour
        As ``#RRGGBB``.
    x
        Frame numbers, or positions in `Chart.names`; rising.
    y
        A number each, in the chart's unit; NaN where undefined.
    low, high
        Ends of an interval around each, or none at all.
    dashed, hollow
        How it differs from others beside its colour.
    """

    name: str
    colour: str
    x: Sequence[float]
    y: Sequence[float]
    low: Sequence[float] = ()
    high: Sequence[float] = ()
    dashed: bool = False
    hollow: bool = False

    def points(self) -> Iterator[tuple[float, float]]:
        """Yield the points that are defined."""
        return ((x, y) for x, y in zip(self.x, self.y, strict=True) if math.isfinite(y))


@dataclass(frozen=True, slots=True)
class Level:
    """A value across a whole chart, as a mean, with the ends of its interval; NaN without one."""

    name: str
    value: float
    low: float = math.nan
    high: float = math.nan


@dataclass(frozen=True, slots=True)
class Chart:
    """A chart.

    Parameters
    ----------
    title
        Of what is drawn, with its unit, as ``ERR, %``.
    kind
        How it is drawn.
    series
        What is drawn.
    names
        Of the positions 0, 1, ... on the axis; without any, positions are numbers of frames, and
        all such charts share one range.
    unit
        Of the values, ``%`` or ``pp``.
    from_zero
        Whether the axis of values begins at zero.
    share
        A share of the whole at each name, drawn as a pale bar behind the marks; or none.
    level
        A value that is drawn across.
    across
        What positions are where they are neither frames nor names, as ``recall``; in `unit`.
    x_range, y_range
        Ends of the axes; by default as the numbers are.
    """

    title: str
    kind: ChartKind
    series: Sequence[Series]
    names: Sequence[str] = ()
    unit: str = "%"
    from_zero: bool = True
    share: Sequence[float] = ()
    level: Level | None = None
    across: str = ""
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None

    @property
    def of_frames(self) -> bool:
        """Whether positions are numbers of frames."""
        return not self.names and not self.across


@dataclass(frozen=True, slots=True, eq=False)
class HeatMap:
    """How often something is so in each part of the image.

    Parameters
    ----------
    title
        What is.
    values
        ``(rows, columns)`` in ``unit``; NaN where it is not known.
    top
        The value of the darkest shade.
    shades
        Some colours from that of 0 to that of ``top``, as ``#RRGGBB``.
    picture
        A PNG file of a pixel a cell.
    unit
        Of the values.
    """

    title: str
    values: npt.NDArray[np.float64]
    top: float
    shades: Sequence[str]
    picture: bytes
    unit: str = "% of the frames"

    @property
    def kind(self) -> ChartKind:
        """How it is drawn."""
        return ChartKind.MAP

    @property
    def most(self) -> float:
        """The greatest value that is known."""
        return float(np.nan_to_num(self.values).max())

    @property
    def of_frames(self) -> bool:
        """Whether positions are numbers of frames: they are places in the image."""
        return False


def thinned(series: Series, most: int = POINTS) -> Series:
    """Return a series of at most ``most`` points: each is the mean of neighbours.

    >>> thinned(Series("a", "#000000", [0, 1, 2, 3], [1.0, 3.0, 5.0, 7.0]), most=2)
    Series(name='a', colour='#000000', x=[0, 2], y=[2.0, 6.0], low=(), high=(), \
dashed=False, hollow=False)
    """
    size = -(-len(series.x) // most)
    if size <= 1:
        return series
    places = range(0, len(series.x), size)
    return replace(
        series,
        x=[series.x[place] for place in places],
        y=[_mean(series.y[place : place + size]) for place in places],
        low=(),
        high=(),
    )


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return sum(known) / len(known) if known else math.nan
