"""Where the parts of a chart lie: ranges, ticks, lines, bars, marks and intervals.

Own geometry rather than a library for charts: the page needs no script to show a chart, keeps its
letters' size on any screen, follows the colours of the dark, and paper is drawn in a hundredth of a
second. Altair with vl-convert takes 106 MB installed, half a second for the first chart and a tenth
for each, and brings 0.9 MB of script to a page, which then must be allowed to evaluate code.

Heights are percent from the top. Positions are in the units of the data, so that a page can zoom by
changing a ``viewBox``; on paper they are percent from the left.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.report.chart import Chart, ChartKind, HeatMap, Key, Look, Series

MARKED: Final = 40
"""Up to this many points of a line each has a mark."""
SHADES: Final = 32
"""Steps of the scale below a heat map."""
_X_TICKS: Final = 8
_Y_TICKS: Final = 5
_STEPS: Final = (1, 2, 2.5, 5, 10)

Point = tuple[float, float]


# --- Ranges ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Span:
    """A closed range of numbers."""

    low: float
    high: float

    @property
    def size(self) -> float:
        """Its length."""
        return self.high - self.low

    def percent(self, value: float) -> float:
        """Return where a value stands in it, from 0 to 100."""
        return round(100 * (value - self.low) / self.size, 2)

    def down(self, value: float) -> float:
        """Return where a value stands from the top, from 0 to 100."""
        return round(100 * (self.high - value) / self.size, 2)


@dataclass(frozen=True, slots=True)
class Tick:
    """A number on an axis: where it stands, in percent from the left or the bottom."""

    place: float
    text: str


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


def _ticked(span: Span, count: int) -> list[Tick]:
    return [
        Tick(span.percent(each), f"{each:g}".replace("-", "\N{MINUS SIGN}"))
        for each in ticks(span, count)
    ]


def span_of_frames(charts: Iterable[Chart | HeatMap]) -> Span:
    """Return the range that charts along the drive share."""
    along = [chart for chart in charts if isinstance(chart, Chart) and chart.of_frames]
    numbers = [x for chart in along for each in chart.series for x in each.x]
    if not numbers:
        return Span(0, 1)
    low, high = min(numbers), max(numbers)
    margin = max((high - low) / 80, 0.5)
    return Span(low - margin, high + margin)


# --- Parts ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Shape:
    """The parts of a series; a point is its position and its height."""

    series: Series
    runs: Sequence[Sequence[Point]] = ()
    """Points joined by a line, which breaks where a value is undefined."""
    bars: Sequence[tuple[float, float, float, float]] = ()
    """Left, width, top and height."""
    ends: Sequence[tuple[float, float, float]] = ()
    """Intervals: a position and two heights."""
    marks: Sequence[Point] = ()

    @property
    def path(self) -> str:
        """The line or the bars as an SVG path."""
        lines = ("L".join(f"{x:g} {y:g}" for x, y in run) for run in self.runs)
        bars = (f"M{x:g} {y:g}h{w:g}v{h:g}h{-w:g}z" for x, w, y, h in self.bars)
        return "".join([*(f"M{line}" for line in lines), *bars])

    @property
    def dots(self) -> str:
        """The marks as an SVG path of lines without length, whose ends are round."""
        return "".join(f"M{x:g} {y:g}h0" for x, y in self.marks)

    @property
    def intervals(self) -> str:
        """The intervals as an SVG path."""
        return "".join(f"M{x:g} {low:g}V{high:g}" for x, low, high in self.ends)


@dataclass(frozen=True, slots=True)
class Mark:
    """A number in a row, in percent from the left."""

    series: Series
    place: float
    text: str
    low: float | None = None
    high: float | None = None
    """Ends of the interval, within the chart."""
    cut: str = ""
    """``left``, ``right`` or ``both``, where the interval reaches beyond the chart."""


@dataclass(frozen=True, slots=True)
class MarkRow:
    """A row of marks."""

    name: str
    marks: Sequence[Mark]
    share: float | None = None
    sums: bool = False


@dataclass(frozen=True, slots=True)
class Drawing:
    """A chart as it is drawn."""

    chart: Chart
    x: Span
    y: Span
    x_ticks: Sequence[Tick]
    y_ticks: Sequence[Tick]
    shapes: Sequence[Shape] = ()
    """Of lines, bars and points."""
    rows: Sequence[MarkRow] = ()
    """Of marks."""

    @property
    def zero(self) -> float | None:
        """Where zero is, in percent from the bottom; None where it is the edge, or not there."""
        return self.y.percent(0) if self.y.low < 0 < self.y.high else None

    @property
    def level(self) -> float | None:
        """The height of the chart's level; None where it has none."""
        return self.y.down(self.chart.level.value) if self.chart.level else None

    @property
    def band(self) -> tuple[float, float] | None:
        """The top and the height of the level's interval; None where it has none."""
        level = self.chart.level
        if level is None or not (math.isfinite(level.low) and math.isfinite(level.high)):
            return None
        top = self.y.down(level.high)
        return top, round(self.y.down(level.low) - top, 2)

    def values(self) -> dict[str, Any]:
        """Return what a script needs to show values: as JSON has it, None where undefined."""
        level = self.chart.level
        return {
            "unit": self.chart.unit,
            "frames": self.chart.of_frames,
            "across": self.chart.across,
            "names": [*self.chart.names],
            "x": [self.x.low, self.x.high],
            "y": [self.y.low, self.y.high],
            "level": level
            and {
                "name": level.name,
                "value": _number(level.value),
                "low": _number(level.low),
                "high": _number(level.high),
            },
            "series": [_values(each) for each in self.chart.series],
        }

    def on_paper(self) -> dict[str, Any]:
        """Return what Typst draws, as JSON has it."""
        at = self.x.percent
        return {
            "kind": self.chart.kind,
            "title": f"{self.chart.title}, {self.chart.unit}",
            "across": f"{self.chart.across}, {self.chart.unit}"
            if self.chart.across
            else "frame"
            if self.chart.of_frames
            else "",
            "x_ticks": [[each.place, each.text] for each in self.x_ticks],
            "y_ticks": [[each.place, each.text] for each in self.y_ticks],
            "zero": self.zero,
            "level": self.level,
            "band": self.band,
            "shapes": [
                {
                    "look": _look(each.series.look),
                    "runs": [[[at(x), y] for x, y in run] for run in each.runs],
                    "bars": [[at(x), at(x + w) - at(x), y, h] for x, w, y, h in each.bars],
                    "ends": [[at(x), low, high] for x, low, high in each.ends],
                    "marks": [[at(x), y] for x, y in each.marks if _seen(at(x)) and _seen(y)],
                }
                for each in self.shapes
            ],
            "rows": [
                {
                    "name": row.name,
                    "share": row.share,
                    "sums": row.sums,
                    "marks": [
                        {
                            "look": _look(mark.series.look),
                            "at": mark.place,
                            "low": mark.low,
                            "high": mark.high,
                            "cut": mark.cut,
                        }
                        for mark in row.marks
                    ],
                }
                for row in self.rows
            ],
        }


@dataclass(frozen=True, slots=True)
class HeatDrawing:
    """A heat map as it is drawn."""

    chart: HeatMap

    @property
    def size(self) -> tuple[int, int]:
        """Cells across and down."""
        rows, columns = self.chart.values.shape
        return columns, rows

    @property
    def shades(self) -> list[str]:
        """The colours of the scale, as ``#RRGGBB``."""
        return [f"#{bytes(shade).hex()}" for shade in self.chart.shades(SHADES)]

    def values(self) -> dict[str, Any]:
        """Return the numbers row by row, in runs: how many, and which in tenths; -1: unknown."""
        tenths = np.rint(10 * np.nan_to_num(self.chart.values, nan=-0.1)).astype(int)
        return {
            "title": self.chart.title,
            "unit": self.chart.unit,
            "size": [*self.size],
            "runs": [*_run_lengths(tenths.ravel())],
        }

    def on_paper(self) -> dict[str, Any]:
        """Return what Typst draws beside the picture, as JSON has it."""
        return {
            "kind": self.chart.kind,
            "title": self.chart.title,
            "shades": self.shades,
            "top": f"{self.chart.top:.3g} %",
        }


def _run_lengths(numbers: npt.NDArray[np.int_]) -> Iterator[int]:
    """Yield the length and the number of each run of equal numbers."""
    edges = np.flatnonzero(np.diff(numbers)) + 1
    for start, end in zip([0, *edges.tolist()], [*edges.tolist(), len(numbers)], strict=True):
        yield end - start
        yield int(numbers[start])


# --- Drawing --------------------------------------------------------------------------------------


def drawn(chart: Chart | HeatMap, frames: Span | None = None) -> Drawing | HeatDrawing:
    """Return a chart as it is drawn; one along the drive over the range of frames given."""
    if isinstance(chart, HeatMap):
        return HeatDrawing(chart)
    y = Span(*chart.y_range) if chart.y_range else _values_span(chart)
    numbers = _ticked(y, _Y_TICKS)
    if chart.kind is ChartKind.MARKS:
        return Drawing(chart, y, y, numbers, numbers, rows=[*_rows(chart, y)])
    x, x_ticks = _positions(chart, frames)
    shapes = [_shape(chart.kind, each, y) for each in chart.series]
    return Drawing(chart, x, y, x_ticks, numbers, shapes)


def _positions(chart: Chart, frames: Span | None) -> tuple[Span, list[Tick]]:
    """Return the range of a chart's positions, and what stands at them."""
    if chart.of_frames:
        x = frames or span_of_frames([chart])
        return x, [Tick(x.percent(t), f"{t:.0f}") for t in ticks(x, _X_TICKS) if t == int(t)]
    if chart.across:
        numbers = [number for each in chart.series for number in each.x]
        x = Span(*(chart.x_range or (min(numbers), max(numbers))))
        return x, _ticked(x, _Y_TICKS)
    if chart.kind is ChartKind.POINTS:
        # There is no room for so many names: the caption has some, and the pointer shows them.
        margin = max(len(chart.names) / 80, 0.5)
        return Span(-margin, len(chart.names) - 1 + margin), []
    x = Span(-0.3, len(chart.names) - 0.7)
    return x, [Tick(x.percent(place), name) for place, name in enumerate(chart.names)]


def _values_span(chart: Chart) -> Span:
    """Return the range of a chart's values, a little wider than they are."""
    found = [each for each in chart.share if math.isfinite(each)]
    for each in chart.series:
        found += [value for value in (*each.y, *each.low, *each.high) if math.isfinite(value)]
    if level := chart.level:
        found += [each for each in (level.value, level.low, level.high) if math.isfinite(each)]
    low, high = min(found, default=0.0), max(found, default=1.0)
    if chart.from_zero:
        low, high = min(low, 0.0), max(high, 0.0)
    room = max((high - low) * 0.06, 0.05)
    return Span(low - room if low < 0 or not chart.from_zero else low, high + room)


def _shape(kind: ChartKind, series: Series, y: Span) -> Shape:
    marks = [(x, y.down(value)) for x, value in series.points()]
    if kind is ChartKind.BARS:
        zero = y.down(0)
        width = 0.86 * min((b - a for a, b in zip(series.x, series.x[1:], strict=False)), default=1)
        bars = [
            (round(x - width / 2, 2), width, min(at, zero), round(abs(zero - at), 2))
            for x, at in marks
        ]
        return Shape(series, bars=bars)
    if kind is ChartKind.POINTS:
        found = zip(series.x, series.low, series.high, strict=False)
        ends = [(x, y.down(low), y.down(high)) for x, low, high in found if low <= high]
        return Shape(series, ends=ends, marks=marks)
    runs: list[list[Point]] = [[]]
    for x, value in zip(series.x, series.y, strict=True):
        if math.isfinite(value):
            runs[-1].append((x, y.down(value)))
        elif runs[-1]:
            runs.append([])
    return Shape(series, [run for run in runs if run], marks=marks if len(marks) <= MARKED else ())


def _rows(chart: Chart, values: Span) -> Iterator[MarkRow]:
    last = len(chart.names) - chart.sums
    for place, name in enumerate(chart.names):
        marks = [mark for each in chart.series if (mark := _mark(chart, each, place, values))]
        known = chart.share and math.isfinite(chart.share[place])
        share = values.percent(chart.share[place]) if known else None
        yield MarkRow(name, marks, share, sums=place == last)


def _mark(chart: Chart, series: Series, place: int, values: Span) -> Mark | None:
    if place not in series.x:
        return None
    at = [*series.x].index(place)
    value = series.y[at]
    if not math.isfinite(value):
        return None
    middle, text = values.percent(value), f"{series.name}: {value:.2f} {chart.unit}"
    low, high = (ends[at] if ends else math.nan for ends in (series.low, series.high))
    if not (math.isfinite(low) and math.isfinite(high)):
        return Mark(series, middle, text)
    text += f" ({low:.2f} to {high:.2f})"
    beyond = low < values.low, high > values.high
    cut = {(True, False): "left", (False, True): "right", (True, True): "both"}.get(beyond, "")
    left, right = (min(max(values.percent(end), 0.0), 100.0) for end in (low, high))
    return Mark(series, middle, text, left, right, cut)


def _seen(percent: float) -> bool:
    return -0.5 <= percent <= 100.5


def _look(look: Look) -> dict[str, Any]:
    return {"colour": look.colour, "dash": look.dash, "mark": look.mark, "hollow": look.hollow}


def key_on_paper(key: Key) -> dict[str, Any]:
    """Return an entry of a legend as JSON has it."""
    return {"name": key.name, "kind": key.kind, "look": _look(key.look)}


def _values(series: Series) -> dict[str, Any]:
    told = {"name": series.name, "colour": series.look.colour, "x": [*series.x]}
    ends = {"low": series.low, "high": series.high} if series.low else {}
    numbers = {"y": series.y, **ends}
    return told | {name: [_number(n) for n in each] for name, each in numbers.items()}


def _number(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
