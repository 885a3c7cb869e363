"""Where the parts of a chart lie, in percent from the left and the top: for a page and for paper.

Own geometry rather than a library for charts: the page needs no script to show a chart, keeps its
letters' size on any screen and follows a dark theme, and paper is drawn in a hundredth of a second.
Altair with vl-convert takes 106 MB installed, half a second for the first chart and a tenth for
each, and adds 0.9 MB of script to a page, which must then be allowed to evaluate code.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from roadeval.report.chart import Chart, ChartKind, Look, Series

MARKED: Final = 40
"""Most marks along a line: a line with more points has none, or spaced ones."""
_X_TICKS: Final = 8
_Y_TICKS: Final = 5
_STEPS: Final = (1, 2, 2.5, 5, 10)

Point = tuple[float, float]
Tick = tuple[float, str]
"""A place on an axis, from the left or the bottom, and the number or name there."""


@dataclass(frozen=True)
class Span:
    """A closed range of numbers."""

    low: float
    high: float

    def percent(self, value: float) -> float:
        """Return where a value lies in it, from 0 to 100."""
        return round(100 * (value - self.low) / (self.high - self.low), 3)

    def down(self, value: float) -> float:
        """Return where a value lies in it, from the top."""
        return round(100 - self.percent(value), 3)


def ticks(span: Span, count: int) -> list[float]:
    """Return about ``count`` round numbers in a range.

    >>> ticks(Span(0, 9), 4)
    [0.0, 2.5, 5.0, 7.5]
    """
    rough = (span.high - span.low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(each * power for each in _STEPS if each * power >= rough * 0.999)
    first = math.ceil(span.low / step - 1e-9)
    last = math.floor(span.high / step + 1e-9)
    return [round(place * step, 10) for place in range(first, last + 1)]


def _ticked(span: Span) -> list[Tick]:
    return [
        (span.percent(each), f"{each:g}".replace("-", "\N{MINUS SIGN}"))
        for each in ticks(span, _Y_TICKS)
    ]


def span_of_frames(charts: Iterable[Chart]) -> Span:
    """Return the range that charts along the drive share."""
    along = (each for chart in charts if chart.of_frames for each in chart.series)
    numbers = [x for each in along for x in each.x]
    if not numbers:
        return Span(0, 1)
    low, high = min(numbers), max(numbers)
    margin = max((high - low) / 80, 0.5)
    return Span(low - margin, high + margin)


@dataclass(frozen=True)
class Shape:
    """The parts of a series."""

    name: str
    look: Look
    runs: Sequence[Sequence[Point]] = ()
    """Points joined by a line, which breaks where a value is undefined."""
    marks: Sequence[Point] = ()

    @property
    def path(self) -> str:
        """The line as an SVG path."""
        return "".join("M" + "L".join(f"{x:g} {y:g}" for x, y in run) for run in self.runs)

    @property
    def dots(self) -> str:
        """The marks as an SVG path of lines without length, whose ends are round."""
        return "".join(f"M{x:g} {y:g}h0" for x, y in self.marks)


@dataclass(frozen=True)
class Mark:
    """A number in a row."""

    name: str
    """Of its series."""
    look: Look
    at: float
    text: str
    low: float | None = None
    high: float | None = None
    """Ends of the interval, within the chart."""


@dataclass(frozen=True)
class MarkRow:
    """A row of marks."""

    name: str
    marks: Sequence[Mark]
    share: float | None
    """The width of the pale bar behind them."""
    sums: bool
    """Whether a rule is above it."""


@dataclass(frozen=True)
class Drawing:
    """A chart as it is drawn."""

    kind: str
    title: str
    """With the unit."""
    across: str
    """What the axis at the bottom shows; empty where its names say it."""
    x: Span
    y: Span
    """The ranges of the axes."""
    x_ticks: Sequence[Tick]
    y_ticks: Sequence[Tick]
    zero: float | None
    """The place of zero, from the left or the bottom; None at the edge or outside."""
    level: float | None
    band: tuple[float, float] | None
    """The place of the chart's level, and the top and height of its interval, if there are any."""
    shapes: Sequence[Shape] = ()
    """Of lines."""
    rows: Sequence[MarkRow] = ()
    """Of marks."""


def drawn(chart: Chart, frames: Span | None = None) -> Drawing:
    """Return a chart as it is drawn; one along the drive over the range of frames given."""
    y = Span(*chart.y_range) if chart.y_range else _values_span(chart)
    numbers, is_rows = _ticked(y), chart.kind is ChartKind.MARKS
    x, x_ticks = (y, numbers) if is_rows else _positions(chart, frames)
    level, band = chart.level, None
    if level and math.isfinite(level.low) and math.isfinite(level.high):
        band = y.down(level.high), round(y.down(level.low) - y.down(level.high), 3)
    across = f"{chart.across}, {chart.unit}" if chart.across else ""
    return Drawing(
        chart.kind,
        f"{chart.title}, {chart.unit}",
        "frame" if chart.of_frames else across,
        x,
        y,
        x_ticks,
        numbers,
        zero=y.percent(0) if y.low < 0 < y.high else None,
        level=y.down(level.value) if level else None,
        band=band,
        shapes=()
        if is_rows
        else [_shape(each, x, y, spaced_marks=chart.spaced_marks) for each in chart.series],
        rows=[*_rows(chart, y)] if is_rows else (),
    )


def _positions(chart: Chart, frames: Span | None) -> tuple[Span, list[Tick]]:
    """Return the range of a chart's positions, and what is written at them."""
    if chart.of_frames:
        x = frames or span_of_frames([chart])
        return x, [(x.percent(t), f"{t:.0f}") for t in ticks(x, _X_TICKS) if t == int(t)]
    if chart.across:
        numbers = [number for each in chart.series for number in each.x]
        x = Span(*(chart.x_range or (min(numbers), max(numbers))))
        return x, _ticked(x)
    x = Span(-0.3, len(chart.names) - 0.7)
    return x, [(x.percent(place), name) for place, name in enumerate(chart.names)]


def _values_span(chart: Chart) -> Span:
    """Return the range of a chart's values, a little wider than they are."""
    found = [*chart.share]
    for each in chart.series:
        found += [*each.y, *each.low, *each.high]
    if level := chart.level:
        found += [level.value, level.low, level.high]
    known = [each for each in found if math.isfinite(each)]
    low, high = min(known, default=0.0), max(known, default=1.0)
    if chart.from_zero:
        low, high = min(low, 0.0), max(high, 0.0)
    room = max((high - low) * 0.06, 0.05)
    return Span(low - room if low < 0 or not chart.from_zero else low, high + room)


def _shape(series: Series, x: Span, y: Span, *, spaced_marks: bool) -> Shape:
    marks = [(x.percent(at), y.down(value)) for at, value in series.points()]
    seen = [(at, top) for at, top in marks if -0.5 <= at <= 100.5 and -0.5 <= top <= 100.5]
    runs: list[list[Point]] = [[]]
    for at, value in zip(series.x, series.y, strict=True):
        if math.isfinite(value):
            runs[-1].append((x.percent(at), y.down(value)))
        elif runs[-1]:
            runs.append([])
    step = -(-len(marks) // MARKED)
    shown = seen[:: step or 1] if step <= 1 or spaced_marks else ()
    return Shape(series.name, series.look, [run for run in runs if run], marks=shown)


def _rows(chart: Chart, values: Span) -> Iterator[MarkRow]:
    for place, name in enumerate(chart.names):
        marks = [mark for each in chart.series if (mark := _mark(chart, each, place, values))]
        known = chart.share and math.isfinite(chart.share[place])
        share = values.percent(chart.share[place]) if known else None
        yield MarkRow(name, marks, share, sums=place == len(chart.names) - chart.sums)


def _mark(chart: Chart, series: Series, place: int, values: Span) -> Mark | None:
    at = [*series.x].index(place) if place in series.x else None
    if at is None or not math.isfinite(value := series.y[at]):
        return None
    middle, text = values.percent(value), f"{series.name}: {value:.2f} {chart.unit}"
    low, high = (ends[at] if ends else math.nan for ends in (series.low, series.high))
    if not (math.isfinite(low) and math.isfinite(high)):
        return Mark(series.name, series.look, middle, text)
    text += f" ({low:.2f} to {high:.2f})"
    left, right = (min(max(values.percent(end), 0.0), 100.0) for end in (low, high))
    return Mark(series.name, series.look, middle, text, left, right)


def values(chart: Chart, drawing: Drawing) -> dict[str, Any]:
    """Return what a page's script needs to show values: as JSON has it, None where undefined."""
    level = chart.level
    ends = ("value", "low", "high")
    return {
        "unit": chart.unit,
        "frames": chart.of_frames,
        "across": chart.across,
        "names": [*chart.names],
        "x": [drawing.x.low, drawing.x.high],
        "y": [drawing.y.low, drawing.y.high],
        "level": level and {"name": level.name} | {e: _number(getattr(level, e)) for e in ends},
        "series": [
            {"name": each.name, "colour": each.look.colour, "x": [*each.x]}
            | {
                name: [*map(_number, own)]
                for name in ("y", "low", "high")
                if (own := getattr(each, name))
            }
            for each in chart.series
        ],
    }


def _number(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
