"""Charts as plain SVG: shapes in the units of the data, ticks in percent of the drawing.

Plain SVG rather than a library for charts: it is there without JavaScript, prints, follows the
colours of the page in the dark, and costs a few kilobytes. A drawing is stretched to its place
(`preserveAspectRatio="none"`), while lines, letters and marks keep their size; to zoom is to change
its `viewBox`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from roadeval.report.chart import Chart, ChartKind, HeatMap, Level, Series
from roadeval.report.page.heat import HeatDrawing
from roadeval.report.page.mark_rows import MarkRow, rows_of
from roadeval.report.page.scales import Span, Tick, short, ticked, ticks

HEIGHT: Final = 1000
"""Of a drawing, in its own units."""
MARKED: Final = 40
"""Up to this many points of a line each has a mark."""
_X_TICKS: Final = 8
_Y_TICKS: Final = 4


@dataclass(frozen=True, slots=True)
class Shape:
    """The drawing of a series: SVG paths of its line or bars, its marks and its intervals."""

    series: Series
    path: str
    marks: str
    intervals: str = ""


@dataclass(frozen=True, slots=True)
class Drawing:
    """A chart as it is drawn.

    Parameters
    ----------
    chart
        What is drawn.
    x, y
        The ranges of its axes.
    x_ticks, y_ticks
        Numbers on them.
    shapes
        Of lines, bars and points, in the units of ``x`` and of `HEIGHT`.
    rows
        Of marks.
    """

    chart: Chart
    x: Span
    y: Span
    x_ticks: Sequence[Tick]
    y_ticks: Sequence[Tick]
    shapes: Sequence[Shape] = ()
    rows: Sequence[MarkRow] = ()

    @property
    def view(self) -> str:
        """The drawing's ``viewBox``."""
        return f"{short(self.x.low)} 0 {short(self.x.size)} {HEIGHT}"

    @property
    def zero(self) -> str | None:
        """Where zero is, in percent from the bottom; None where it is the edge, or not there."""
        return self.y.percent(0) if self.y.low < 0 < self.y.high else None

    @property
    def level(self) -> str | None:
        """Where the chart's level is, in the units of `HEIGHT`; None where it has none."""
        level = self.chart.level
        return short(_height(level.value, self.y)) if level else None

    @property
    def band(self) -> tuple[str, str] | None:
        """The top and the height of the level's interval; None where it has none."""
        level = self.chart.level
        if level is None or not (math.isfinite(level.low) and math.isfinite(level.high)):
            return None
        top = _height(level.high, self.y)
        return short(top), short(_height(level.low, self.y) - top)

    def values(self) -> dict[str, Any]:
        """Return what a script needs to show values: as JSON has it, None where undefined."""
        return {
            "unit": self.chart.unit,
            "frames": self.chart.of_frames,
            "across": self.chart.across,
            "names": [*self.chart.names],
            "x": [self.x.low, self.x.high],
            "y": [self.y.low, self.y.high],
            "level": _told(self.chart.level) if self.chart.level else None,
            "series": [_values(each) for each in self.chart.series],
        }


def drawn(chart: Chart | HeatMap, frames: Span | None = None) -> Drawing | HeatDrawing:
    """Return a chart as it is drawn; one along the drive over the range of frames given."""
    if isinstance(chart, HeatMap):
        return HeatDrawing(chart)
    y = Span(*chart.y_range) if chart.y_range else _values_span(chart)
    if chart.kind is ChartKind.MARKS:
        numbers = ticked(y, _Y_TICKS)
        return Drawing(chart, y, y, numbers, numbers, rows=rows_of(chart, y))
    x, x_ticks = _positions(chart, frames)
    shapes = [_shape(chart.kind, each, y) for each in chart.series]
    return Drawing(chart, x, y, x_ticks, ticked(y, _Y_TICKS), shapes)


def span_of_frames(charts: Iterable[Chart | HeatMap]) -> Span:
    """Return the range that charts along the drive share."""
    along = [chart for chart in charts if isinstance(chart, Chart) and chart.of_frames]
    numbers = [x for chart in along for each in chart.series for x in each.x]
    if not numbers:
        return Span(0, 1)
    low, high = min(numbers), max(numbers)
    margin = max((high - low) / 80, 0.5)
    return Span(low - margin, high + margin)


def _positions(chart: Chart, frames: Span | None) -> tuple[Span, list[Tick]]:
    """Return the range of a chart's positions, and what stands at them."""
    if chart.of_frames:
        x = frames or span_of_frames([chart])
        return x, [Tick(x.percent(t), f"{t:.0f}") for t in ticks(x, _X_TICKS) if t == int(t)]
    if chart.across:
        numbers = [number for each in chart.series for number in each.x]
        x = Span(*(chart.x_range or (min(numbers), max(numbers))))
        return x, ticked(x, _Y_TICKS)
    if chart.kind is ChartKind.POINTS:
        # So many names have no room: the pointer tells them.
        margin = max(len(chart.names) / 80, 0.5)
        return Span(-margin, len(chart.names) - 1 + margin), []
    x = Span(-0.3, len(chart.names) - 0.7)
    return x, [Tick(x.percent(place), name) for place, name in enumerate(chart.names)]


def _values_span(chart: Chart) -> Span:
    """Return the range of a chart's values, a little wider than they are."""
    found = [*chart.share]
    for each in chart.series:
        found += [value for value in (*each.y, *each.low, *each.high) if math.isfinite(value)]
    if level := chart.level:
        found += [each for each in (level.value, level.low, level.high) if math.isfinite(each)]
    low, high = min(found, default=0.0), max(found, default=1.0)
    if chart.from_zero:
        low, high = min(low, 0.0), max(high, 0.0)
    room = max((high - low) * 0.06, 0.05)
    return Span(low - room if low < 0 or not chart.from_zero else low, high + room)


def _height(value: float, y: Span) -> float:
    """Return where a value stands in the units of `HEIGHT`, from the top down."""
    return HEIGHT * (1 - (value - y.low) / y.size)


def _shape(kind: ChartKind, series: Series, y: Span) -> Shape:
    points = [(x, _height(value, y)) for x, value in series.points()]
    if kind is ChartKind.BARS:
        return Shape(series, _bars(series, points, y), "")
    marks = "".join(f"M{short(x)} {short(top)}h0" for x, top in points)
    if kind is ChartKind.POINTS:
        return Shape(series, "", marks, _intervals(series, y))
    return Shape(series, _line(series, y), marks if len(points) <= MARKED else "")


def _bars(series: Series, points: Sequence[tuple[float, float]], y: Span) -> str:
    zero = _height(0, y)
    half = 0.43 * min((b - a for a, b in zip(series.x, series.x[1:], strict=False)), default=1)
    return "".join(
        f"M{short(x - half)} {short(zero)}V{short(top)}h{short(2 * half)}V{short(zero)}z"
        for x, top in points
    )


def _intervals(series: Series, y: Span) -> str:
    """Return the path of the points' intervals."""
    ends = zip(series.x, series.low, series.high, strict=False)
    return "".join(
        f"M{short(x)} {short(_height(low, y))}V{short(_height(high, y))}"
        for x, low, high in ends
        if math.isfinite(low) and math.isfinite(high)
    )


def _line(series: Series, y: Span) -> str:
    """Return the path of a line, broken where a value is undefined."""
    path, pen = [], "M"
    for x, value in zip(series.x, series.y, strict=True):
        if math.isfinite(value):
            path.append(f"{pen}{short(x)} {short(_height(value, y))}")
            pen = "L"
        else:
            pen = "M"
    return "".join(path)


def _values(series: Series) -> dict[str, Any]:
    told = {"name": series.name, "colour": series.colour, "x": [*series.x]}
    ends = {"low": series.low, "high": series.high} if series.low else {}
    numbers = {"y": series.y, **ends}
    return told | {name: [_number(n) for n in each] for name, each in numbers.items()}


def _told(level: Level) -> dict[str, Any]:
    """Return a level as a script shows it."""
    numbers = {"value": level.value, "low": level.low, "high": level.high}
    return {"name": level.name} | {name: _number(each) for name, each in numbers.items()}


def _number(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
