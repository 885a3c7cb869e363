"""The places of a chart's parts, in percent from the left and the top, for a page and for paper.

Page and PDF draw the same places; only the paper's figures are drawn by Matplotlib. So a page
needs no script to show a chart, keeps its letters' size on any screen and follows a dark theme, and
paper is drawn in a hundredth of a second. Matplotlib takes 0.3 to 0.7 s to import and 0.1 s for
each chart, and an SVG of it has letters that shrink with the screen. Altair with vl-convert takes
106 MB installed, half a second for the first chart and a tenth for each further one, and adds
0.9 MB of script to a page, which must then be allowed to evaluate code.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from roadeval.data.words import MINUS
from roadeval.report.chart import Chart, ChartKind, Look, Series

MARKED: Final = 40
"""Greatest number of marks along a line: a line with more points has no marks."""
ROOM: Final = 0.06
"""Share of an axis after its last tick, so that on a telephone half of a number of three digits has
room there."""
_X_TICKS: Final = 8
_Y_TICKS: Final = 5
_STEPS: Final = (1, 2, 2.5, 5, 10)

Point = tuple[float, float]
Tick = tuple[float, str]
"""A place on an axis, in percent from the left or the bottom, with its number or name."""


@dataclass(frozen=True)
class AxisRange:
    """The closed range of numbers on an axis."""

    low: float
    high: float

    def percent(self, value: float) -> float:
        """Return the place of a value, from 0 to 100."""
        return round(100 * (value - self.low) / (self.high - self.low), 3)

    def down(self, value: float) -> float:
        """Return the place of a value from the top, from 0 to 100."""
        return round(100 - self.percent(value), 3)


def ticks(span: AxisRange, count: int) -> list[float]:
    """Return about ``count`` round numbers in a range.

    >>> ticks(AxisRange(0, 9), 4)
    [0.0, 2.5, 5.0, 7.5]
    """
    rough = (span.high - span.low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(step * power for step in _STEPS if step * power >= rough * 0.999)
    first = math.ceil(span.low / step - 1e-9)
    last = math.floor(span.high / step + 1e-9)
    return [round(place * step, 10) for place in range(first, last + 1)]


def _number_ticks(span: AxisRange) -> list[Tick]:
    """Return ticks at round numbers."""
    return [(span.percent(tick), f"{tick:g}".replace("-", MINUS)) for tick in ticks(span, _Y_TICKS)]


def _with_room(span: AxisRange) -> AxisRange:
    """Return a range with room at its end for the last tick's number, which is centred there."""
    end = ticks(span, _Y_TICKS)[-1] + ROOM * (span.high - span.low)
    return AxisRange(span.low, max(span.high, end))


def range_of_frames(charts: Iterable[Chart]) -> AxisRange:
    """Return the range that charts along the drive share."""
    along = (series for chart in charts if chart.of_frames for series in chart.series)
    numbers = [x for series in along for x in series.x]
    if not numbers:
        return AxisRange(0, 1)
    low, high = min(numbers), max(numbers)
    margin = max((high - low) / 80, 0.5)
    return AxisRange(low - margin, high + margin)


@dataclass(frozen=True)
class Shape:
    """The line and the marks of a series."""

    name: str
    look: Look
    runs: Sequence[Sequence[Point]] = ()
    """Points of the line, which breaks where a value is undefined."""
    marks: Sequence[Point] = ()

    @property
    def path(self) -> str:
        """The line as an SVG path."""
        return "".join("M" + "L".join(f"{x:g} {y:g}" for x, y in run) for run in self.runs)


@dataclass(frozen=True)
class Mark:
    """A number in a row."""

    name: str
    """The name of its series."""
    look: Look
    at: float
    text: str
    """The name, the number and its interval as text."""
    low: float | None = None
    high: float | None = None
    """Ends of the interval, cut off at the edges of the chart; None without an interval."""


@dataclass(frozen=True)
class MarkRow:
    """A row of marks."""

    name: str
    marks: Sequence[Mark]
    share: float | None
    """The width of the pale bar behind the marks, in percent; None without a bar."""
    sums: bool
    """Whether a rule lies above the row."""


@dataclass(frozen=True)
class PlacedChart:
    """A chart with the places of its parts."""

    kind: str
    title: str
    """The title with the unit."""
    across: str
    """The quantity on the bottom axis; empty if the axis has names."""
    x: AxisRange
    y: AxisRange
    """The ranges of the axes."""
    x_ticks: Sequence[Tick]
    y_ticks: Sequence[Tick]
    zero: float | None
    """The place of zero from the left or the bottom; None if zero is not inside the chart."""
    level: float | None
    band: tuple[float, float] | None
    """The place of the chart's level from the top, and the top and height of its interval."""
    shapes: Sequence[Shape] = ()
    """The series of a chart of lines."""
    rows: Sequence[MarkRow] = ()
    """The rows of a chart of marks."""


def place_chart(chart: Chart, frames: AxisRange | None = None) -> PlacedChart:
    """Return a chart with its places; ``frames`` is the axis of charts along the drive."""
    y = AxisRange(*chart.y_range) if chart.y_range else _range_of_values(chart)
    if is_rows := chart.kind is ChartKind.MARKS:
        y = _with_room(y)
    numbers = _number_ticks(y)
    x, x_ticks = (y, numbers) if is_rows else _positions(chart, frames)
    level, band = chart.level, None
    if level and math.isfinite(level.low) and math.isfinite(level.high):
        band = y.down(level.high), round(y.down(level.low) - y.down(level.high), 3)
    across = f"{chart.across}, {chart.unit}" if chart.across else ""
    return PlacedChart(
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
        shapes=() if is_rows else [_shape(series, x, y) for series in chart.series],
        rows=[*_rows(chart, y)] if is_rows else (),
    )


def _positions(chart: Chart, frames: AxisRange | None) -> tuple[AxisRange, list[Tick]]:
    """Return the range and the ticks of a chart's positions."""
    if chart.of_frames:
        x = frames or range_of_frames([chart])
        return x, [(x.percent(t), f"{t:.0f}") for t in ticks(x, _X_TICKS) if t == int(t)]
    if chart.across:
        numbers = [number for series in chart.series for number in series.x]
        x = AxisRange(*(chart.x_range or (min(numbers), max(numbers))))
        x = x if chart.low else _with_room(x)
        return x, _number_ticks(x)
    x = AxisRange(-0.3, len(chart.names) - 0.7)
    # Many names, such as names of runs, do not fit beside each other.
    room = max(34 // max(map(len, chart.names), default=1), 1)
    step = -(-len(chart.names) // room) if len(chart.names) > _X_TICKS else 1
    shown = range(0, len(chart.names), step)
    return x, [(x.percent(position), chart.names[position]) for position in shown]


def _range_of_values(chart: Chart) -> AxisRange:
    """Return a range a little wider than a chart's values."""
    values = [*chart.share]
    for series in chart.series:
        values += [*series.y, *series.low, *series.high]
    if level := chart.level:
        values += [level.value, level.low, level.high]
    defined = [value for value in values if math.isfinite(value)]
    low, high = min(defined, default=0.0), max(defined, default=1.0)
    if chart.from_zero:
        low, high = min(low, 0.0), max(high, 0.0)
    room = max((high - low) * 0.06, 0.05)
    return AxisRange(low - room if low < 0 or not chart.from_zero else low, high + room)


def _shape(series: Series, x: AxisRange, y: AxisRange) -> Shape:
    marks = [(x.percent(at), y.down(value)) for at, value in series.points()]
    inside = [(at, top) for at, top in marks if -0.5 <= at <= 100.5 and -0.5 <= top <= 100.5]
    runs: list[list[Point]] = [[]]
    for at, value in zip(series.x, series.y, strict=True):
        if math.isfinite(value):
            runs[-1].append((x.percent(at), y.down(value)))
        elif runs[-1]:
            runs.append([])
    shown = inside if len(marks) <= MARKED else ()
    return Shape(series.name, series.look, [run for run in runs if run], marks=shown)


def _rows(chart: Chart, values: AxisRange) -> Iterator[MarkRow]:
    for position, name in enumerate(chart.names):
        marks = []
        for series in chart.series:
            at = [*series.x].index(position) if position in series.x else None
            if at is None or not math.isfinite(value := series.y[at]):
                continue
            text, interval = f"{series.name}: {value:.2f} {chart.unit}", list[float]()
            low, high = (ends[at] if ends else math.nan for ends in (series.low, series.high))
            if math.isfinite(low) and math.isfinite(high):
                text += f" ({low:.2f} to {high:.2f})"
                interval = [min(max(values.percent(end), 0.0), 100.0) for end in (low, high)]
            marks.append(Mark(series.name, series.look, values.percent(value), text, *interval))
        has_share = chart.share and math.isfinite(chart.share[position])
        share = values.percent(chart.share[position]) if has_share else None
        is_sum = position == len(chart.names) - chart.sums
        yield MarkRow(name, marks, share, sums=is_sum)


def values(chart: Chart, placed: PlacedChart) -> dict[str, Any]:
    """Return the values that a page's script shows, for JSON; undefined values are None."""
    level = chart.level
    ends = ("value", "low", "high")
    return {
        "unit": chart.unit,
        "frames": chart.of_frames,
        "across": chart.across,
        "names": [*chart.names],
        "x": [placed.x.low, placed.x.high],
        "y": [placed.y.low, placed.y.high],
        "level": level and {"name": level.name} | {e: _number(getattr(level, e)) for e in ends},
        "series": [
            {"name": series.name, "colour": series.look.colour, "x": [*series.x]}
            | {
                name: [*map(_number, numbers)]
                for name in ("y", "low", "high")
                if (numbers := getattr(series, name))
            }
            for series in chart.series
        ],
    }


def _number(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
