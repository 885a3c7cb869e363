"""Charts as data: what is drawn, with its values and how it looks, for paper and for a page.

`roadeval.report.charts` makes them of a result's rows, `roadeval.report.drawing` finds where
everything lies, and the templates of `roadeval.report.pdf` and `roadeval.report.page` draw it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

from roadeval.data import BASELINE, FILTERED, UNFILTERED, colours

POINTS: Final = 1500
"""Points of a series along the drive, at most: more do not fit beside each other on a screen."""


@dataclass(frozen=True)
class Look:
    """How a series is drawn; no two variants differ by their colour alone."""

    colour: str
    """As ``#RRGGBB``."""
    dash: str = "solid"
    """``solid``, ``dashed``, ``dotted`` or ``dash-dotted``, as CSS and Typst call them."""
    mark: str = "circle"
    """On paper: ``circle``, ``square``, ``triangle``, ``diamond`` or ``cross``."""
    hollow: bool = False
    """Whether the mark is an outline."""


FAINT: Final = "#666666"
WORSE: Final = colours.hex_of(colours.VERMILLION)
BETTER: Final = colours.hex_of(colours.BLUE)

_KNOWN: Final = {
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
    """Return each variant's look; those that do not come by default take turns at the others."""
    further = (
        replace(own, colour=colours.hex_of(colours.on_paper(colour)))
        for own, colour in zip(_FURTHER, colours.EXTRA, strict=True)
    )
    cycle = [*further]
    others = [name for name in variants if name not in _KNOWN]
    found = {name: cycle[place % len(cycle)] for place, name in enumerate(others)}
    return {name: _KNOWN.get(name) or found[name] for name in variants}


def looks_of_results(masks: Mapping[str, tuple[str, str]]) -> dict[str, Look]:
    """Return the looks of masks of several results, each given by its result and variant.

    A variant keeps its colour; the dash and the filling of the marks tell results apart. Where the
    variants of one result are compared, each has its own look.
    """
    if all(result == variant for result, variant in masks.values()):
        return looks([*masks])
    results = list(dict.fromkeys(result for result, _ in masks.values()))
    own = looks(list(dict.fromkeys(variant for _, variant in masks.values())))
    return {
        name: replace(
            own[variant],
            dash=_DASHES[results.index(result) % len(_DASHES)],
            hollow=results.index(result) % 2 == 1,
        )
        for name, (result, variant) in masks.items()
    }


class ChartKind(StrEnum):
    """How numbers are drawn: lines from left to right, or marks in rows."""

    LINES = "lines"
    MARKS = "marks"


@dataclass(frozen=True)
class Series:
    """Numbers of one look."""

    name: str
    """For the legend."""
    look: Look
    x: Sequence[float]
    """Frame numbers, or positions in `Chart.names`; rising."""
    y: Sequence[float]
    """A number each, in the chart's unit; NaN where undefined."""
    low: Sequence[float] = ()
    high: Sequence[float] = ()
    """Ends of an interval around each, or none at all."""

    def points(self) -> Iterator[tuple[float, float]]:
        """Yield the points that are defined."""
        return ((x, y) for x, y in zip(self.x, self.y, strict=True) if math.isfinite(y))


@dataclass(frozen=True)
class Level:
    """A value across a whole chart, as a mean, with the ends of its interval; NaN without one."""

    name: str
    value: float
    low: float = math.nan
    high: float = math.nan


@dataclass(frozen=True)
class Key:
    """An entry of a legend: a name and what it stands for."""

    name: str
    kind: str
    """``line``, ``mark``, ``both``, ``level`` or ``share``."""
    look: Look = Look(FAINT)


@dataclass(frozen=True)
class Chart:
    """A chart."""

    title: str
    """What is drawn, without its unit, as ``ERR``."""
    kind: ChartKind
    series: Sequence[Series]
    names: Sequence[str] = ()
    """Of the positions 0, 1, ... on the axis; without any, positions are numbers of frames, and all
    such charts share one range."""
    unit: str = "%"
    """Of the values, ``%`` or ``pp``."""
    from_zero: bool = True
    """Whether the axis of values begins at zero."""
    share: Sequence[float] = ()
    """A share of the pixels at each name, drawn as a pale bar behind the marks; or none."""
    level: Level | None = None
    """A value that is drawn across."""
    across: str = ""
    """What positions are where they are neither frames nor names, as ``recall``; in `unit`."""
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    """Ends of the axes; by default as the numbers are."""
    spaced_marks: bool = False
    """Whether lines of many points have marks here and there, rather than none."""
    sums: int = 0
    """How many of the last names sum up the others; a rule sets them apart."""

    @property
    def of_frames(self) -> bool:
        """Whether positions are numbers of frames."""
        return not self.names and not self.across

    def legend(self) -> Iterator[Key]:
        """Yield the entries of its legend."""
        for each in (own for own in self.series if own.x):
            line = "line" if self.across else "both"
            alone = self.kind is ChartKind.MARKS or len(each.x) == 1
            yield Key(each.name, "mark" if alone else line, each.look)
        if self.level:
            yield Key(self.level.name, "level")
        if self.share:
            yield Key("share of the pixels", "share")


def legend(charts: Sequence[Chart]) -> list[Key]:
    """Return what several charts show, each once."""
    return list(dict.fromkeys(key for chart in charts for key in chart.legend()))


def thinned(series: Series, most: int = POINTS) -> Series:
    """Return a series of at most ``most`` points: each is the mean of neighbours.

    >>> made = thinned(Series("a", Look("#000000"), [0, 1, 2, 3], [1.0, 3.0, 5.0, 7.0]), most=2)
    >>> made.x, made.y
    ([0, 2], [2.0, 6.0])
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
