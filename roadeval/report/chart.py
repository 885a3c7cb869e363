"""Charts as data: their values and looks, for paper and for a page.

`roadeval.report.charts` makes charts from a result's rows, `roadeval.report.drawing` places their
parts, and the templates of `roadeval.report.pdf` and `roadeval.report.page` draw the parts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import cycle
from typing import Final

from roadeval.data import BASELINE, FILTERED, UNFILTERED, colours

POINTS: Final = 1500
"""Greatest number of points of a series along the drive: a screen has no room for more."""


@dataclass(frozen=True)
class Look:
    """The look of a series; variants never differ by their colour alone."""

    colour: str
    """The colour as ``#RRGGBB``."""
    dash: str = "solid"
    """``solid``, ``dashed``, ``dotted`` or ``dash-dotted``, as in CSS and Typst."""
    mark: str = "circle"
    """The mark on paper: ``circle``, ``square``, ``triangle``, ``diamond`` or ``cross``."""
    hollow: bool = False
    """Whether the mark is an outline."""


FAINT: Final = "#666666"
WORSE: Final = colours.hex_of(colours.VERMILLION)
BETTER: Final = colours.hex_of(colours.BLUE)

_DEFAULTS: Final = {
    FILTERED: Look(colours.hex_of(colours.FILTERED)),
    UNFILTERED: Look(colours.hex_of(colours.UNFILTERED), "dashed", "square", hollow=True),
    BASELINE: Look(colours.hex_of(colours.on_paper(colours.BLIND)), "dotted", "cross"),
}
_FURTHER: Final = (
    Look("", "dash-dotted", "triangle"),
    Look("", "dashed", "diamond", hollow=True),
    Look("", "solid", "square"),
    Look("", "dotted", "triangle", hollow=True),
    Look("", "dash-dotted", "diamond"),
)
_DASHES: Final = ("solid", "dashed", "dotted", "dash-dotted")


def looks(variants: Sequence[str]) -> dict[str, Look]:
    """Return each variant's look; the variants that a user added take further looks in turn."""
    further = cycle(
        replace(look, colour=colours.hex_of(colours.on_paper(colour)))
        for look, colour in zip(_FURTHER, colours.EXTRA, strict=True)
    )
    return {name: _DEFAULTS.get(name) or next(further) for name in dict.fromkeys(variants)}


def looks_of_results(masks: Mapping[str, tuple[str, str]]) -> dict[str, Look]:
    """Return the looks of masks of several results; ``masks`` has the result and variant of each.

    A variant keeps its colour; the dash and the filling of the marks distinguish results. If
    variants of one result are compared, each variant has a look of its own.
    """
    if all(result == variant for result, variant in masks.values()):
        return looks([*masks])
    results = list(dict.fromkeys(result for result, _ in masks.values()))
    by_variant = looks([variant for _, variant in masks.values()])
    return {
        name: replace(
            by_variant[variant],
            dash=_DASHES[results.index(result) % len(_DASHES)],
            hollow=results.index(result) % 2 == 1,
        )
        for name, (result, variant) in masks.items()
    }


class ChartKind(StrEnum):
    """The form of a chart: lines from left to right, or marks in rows."""

    LINES = "lines"
    MARKS = "marks"


@dataclass(frozen=True)
class Series:
    """Numbers with one look."""

    name: str
    """The name in the legend."""
    look: Look
    x: Sequence[float]
    """Frame numbers, or positions in `Chart.names`; rising."""
    y: Sequence[float]
    """A number at each position, in the chart's unit; NaN if undefined."""
    low: Sequence[float] = ()
    high: Sequence[float] = ()
    """Ends of an interval around each number, or none at all."""

    def points(self) -> Iterator[tuple[float, float]]:
        """Yield the points with a defined number."""
        return ((x, y) for x, y in zip(self.x, self.y, strict=True) if math.isfinite(y))


@dataclass(frozen=True)
class Level:
    """A line across a chart, such as a mean, with the ends of its interval; NaN without one."""

    name: str
    value: float
    low: float = math.nan
    high: float = math.nan


@dataclass(frozen=True)
class LegendEntry:
    """A name in a legend, and the sign beside it."""

    name: str
    kind: str
    """``line``, ``mark``, ``both``, ``level`` or ``share``."""
    look: Look = Look(FAINT)


@dataclass(frozen=True)
class Chart:
    """A chart."""

    title: str
    """The title without the unit, such as ``ERR``."""
    kind: ChartKind
    series: Sequence[Series]
    names: Sequence[str] = ()
    """Names of the positions 0, 1, ... on the axis; without names, positions are numbers of frames,
    and all such charts share one range."""
    unit: str = "%"
    """Unit of the values, ``%`` or ``pp``."""
    from_zero: bool = True
    """Whether the axis of values begins at zero."""
    share: Sequence[float] = ()
    """The share of the pixels at each name, drawn as a pale bar behind the marks; or empty."""
    level: Level | None = None
    """A line across the chart; or None."""
    across: str = ""
    """The quantity, in `unit`, of positions that are neither frames nor names: ``recall``."""
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    """Ends of the axes; by default the ends of the numbers."""
    sums: int = 0
    """How many names at the end sum up the others; a rule separates them."""
    low: bool = False
    """Whether the chart is a ribbon on a page, a few millimetres high."""

    @property
    def of_frames(self) -> bool:
        """Whether positions are numbers of frames."""
        return not self.names and not self.across

    def legend(self) -> Iterator[LegendEntry]:
        """Yield the entries of the chart's legend."""
        for series in self.series:
            if series.x:
                line = "line" if self.across else "both"
                only_marks = self.kind is ChartKind.MARKS or len(series.x) == 1
                yield LegendEntry(series.name, "mark" if only_marks else line, series.look)
        if self.level:
            yield LegendEntry(self.level.name, "level")
        if self.share:
            yield LegendEntry("share of the pixels", "share")


def legend(charts: Sequence[Chart]) -> list[LegendEntry]:
    """Return the legend of several charts, without repetitions."""
    return list(dict.fromkeys(entry for chart in charts for entry in chart.legend()))


def thin(series: Series, most: int = POINTS) -> Series:
    """Return a series of at most ``most`` points, each the mean of neighbours.

    >>> thinned = thin(Series("a", Look("#000000"), [0, 1, 2, 3], [1.0, 3.0, 5.0, 7.0]), most=2)
    >>> thinned.x, thinned.y
    ([0, 2], [2.0, 6.0])
    """
    size = -(-len(series.x) // most)
    if size <= 1:
        return series
    means = []
    for place in range(0, len(series.x), size):
        values = [value for value in series.y[place : place + size] if math.isfinite(value)]
        means.append(sum(values) / len(values) if values else math.nan)
    return replace(series, x=[*series.x[::size]], y=means, low=(), high=())
