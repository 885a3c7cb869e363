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

from roadeval.report.chart import Chart, ChartKind, Series

HEIGHT: Final = 1000
"""Of a drawing, in its own units."""
MARKED: Final = 40
"""Up to this many points each has a mark."""
_X_TICKS: Final = 8
_Y_TICKS: Final = 4
_STEPS: Final = (1, 2, 2.5, 5, 10)


@dataclass(frozen=True, slots=True)
class Span:
    """A closed range of numbers."""

    low: float
    high: float

    @property
    def size(self) -> float:
        """Its length."""
        return self.high - self.low

    def percent(self, value: float) -> str:
        """Return where a value stands in it, from 0 to 100."""
        return _short(100 * (value - self.low) / self.size)


@dataclass(frozen=True, slots=True)
class Tick:
    """A number on an axis: where it stands, in percent from the left or the bottom."""

    place: str
    text: str


@dataclass(frozen=True, slots=True)
class Shape:
    """What is drawn of a series: paths of its line or bars, and of its marks."""

    series: Series
    path: str
    marks: str


@dataclass(frozen=True, slots=True)
class Mark:
    """A number in a row, in percent from the left, and the ends of its interval."""

    series: Series
    place: str
    text: str
    low: str = ""
    width: str = ""


@dataclass(frozen=True, slots=True)
class MarkRow:
    """A row of marks below each other's axis."""

    name: str
    marks: Sequence[Mark]
    share: str


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
        Of lines and bars, in the units of ``x`` and of `HEIGHT`.
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
        return f"{_short(self.x.low)} 0 {_short(self.x.size)} {HEIGHT}"

    @property
    def zero(self) -> str | None:
        """Where zero is, in percent from the bottom; None where it is the edge, or not there."""
        return self.y.percent(0) if self.y.low < 0 < self.y.high else None

    def values(self) -> dict[str, Any]:
        """Return what a script needs to show values: as JSON has it, None where undefined."""
        return {
            "unit": self.chart.unit,
            "frames": self.chart.of_frames,
            "names": [*self.chart.names],
            "x": [self.x.low, self.x.high],
            "y": [self.y.low, self.y.high],
            "series": [
                {
                    "name": each.name,
                    "colour": each.colour,
                    "x": [*each.x],
                    "y": [round(y, 3) if math.isfinite(y) else None for y in each.y],
                }
                for each in self.chart.series
            ],
        }


def drawn(chart: Chart, frames: Span | None = None) -> Drawing:
    """Return a chart as it is drawn; one along the drive over the range of frames given."""
    if chart.kind is ChartKind.MARKS:
        return _in_rows(chart)
    y = _values_span(chart)
    if chart.of_frames:
        x = frames or span_of_frames([chart])
        x_ticks = [Tick(x.percent(t), f"{t:.0f}") for t in ticks(x, _X_TICKS) if t == int(t)]
    else:
        x = Span(-0.3, len(chart.names) - 0.7)
        x_ticks = [Tick(x.percent(place), name) for place, name in enumerate(chart.names)]
    return Drawing(
        chart,
        x,
        y,
        x_ticks,
        _ticks(y, _Y_TICKS),
        [_shape(chart.kind, each, y) for each in chart.series],
    )


def span_of_frames(charts: Iterable[Chart]) -> Span:
    """Return the range that charts along the drive share."""
    numbers = [x for chart in charts if chart.of_frames for each in chart.series for x in each.x]
    if not numbers:
        return Span(0, 1)
    low, high = min(numbers), max(numbers)
    margin = max((high - low) / 80, 0.5)
    return Span(low - margin, high + margin)


def ticks(span: Span, count: int) -> list[float]:
    """Return about ``count`` round numbers in a range.

    >>> ticks(Span(0, 9), 4)
    [0.0, 2.5, 5.0, 7.5]
    """
    rough = span.size / max(count, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(each * power for each in _STEPS if each * power >= rough * 0.999)
    first = math.ceil(span.low / step - 1e-9)
    last = math.floor(span.high / step + 1e-9)
    return [round(place * step, 10) for place in range(first, last + 1)]


def _ticks(span: Span, count: int) -> list[Tick]:
    return [Tick(span.percent(each), f"{each:g}") for each in ticks(span, count)]


def _values_span(chart: Chart) -> Span:
    """Return the range of a chart's values, a little wider than they are."""
    found = [*chart.share]
    for each in chart.series:
        found += [value for value in (*each.y, *each.low, *each.high) if math.isfinite(value)]
    low, high = min(found, default=0.0), max(found, default=1.0)
    if chart.from_zero:
        low, high = min(low, 0.0), max(high, 0.0)
    room = max((high - low) * 0.06, 0.05)
    return Span(low - room if low < 0 or not chart.from_zero else low, high + room)


def _shape(kind: ChartKind, series: Series, y: Span) -> Shape:
    points = [(x, HEIGHT * (1 - (value - y.low) / y.size)) for x, value in series.points()]
    if kind is ChartKind.BARS:
        zero = HEIGHT * (1 + y.low / y.size)
        half = 0.43 * min((b - a for a, b in zip(series.x, series.x[1:], strict=False)), default=1)
        bars = "".join(
            f"M{_short(x - half)} {_short(zero)}V{_short(top)}h{_short(2 * half)}V{_short(zero)}z"
            for x, top in points
        )
        return Shape(series, bars, "")
    few = len(points) <= MARKED
    marks = "".join(f"M{_short(x)} {_short(top)}h0" for x, top in points) if few else ""
    return Shape(series, _line(series, y), marks)


def _line(series: Series, y: Span) -> str:
    """Return the path of a line, broken where a value is undefined."""
    path, pen = [], "M"
    for x, value in zip(series.x, series.y, strict=True):
        if math.isfinite(value):
            path.append(f"{pen}{_short(x)} {_short(HEIGHT * (1 - (value - y.low) / y.size))}")
            pen = "L"
        else:
            pen = "M"
    return "".join(path)


def _in_rows(chart: Chart) -> Drawing:
    values = _values_span(chart)
    rows = [
        MarkRow(
            name,
            [mark for each in chart.series if (mark := _mark(chart, each, place, values))],
            values.percent(chart.share[place]) if chart.share else "",
        )
        for place, name in enumerate(chart.names)
    ]
    return Drawing(chart, values, values, _ticks(values, _Y_TICKS), (), rows=rows)


def _mark(chart: Chart, series: Series, place: int, values: Span) -> Mark | None:
    if place not in series.x:
        return None
    at = [*series.x].index(place)
    value = series.y[at]
    if not math.isfinite(value):
        return None
    text = f"{series.name}: {value:.2f} {chart.unit}"
    low, high = (ends[at] if ends else math.nan for ends in (series.low, series.high))
    if not (math.isfinite(low) and math.isfinite(high)):
        return Mark(series, values.percent(value), text)
    width = _short(100 * (high - low) / values.size)
    text += f" ({low:.2f} to {high:.2f})"
    return Mark(series, values.percent(value), text, values.percent(low), width)


def _short(value: float) -> str:
    """Return a number with few digits."""
    return f"{round(value, 2):g}" if abs(value) < 1e4 else f"{value:.1f}".removesuffix(".0")
