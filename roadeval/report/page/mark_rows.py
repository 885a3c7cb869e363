"""Charts whose marks stand in rows, one below the other: in percent from the left."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from roadeval.report.chart import Chart, Series
from roadeval.report.page.scales import Span, short


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


def rows_of(chart: Chart, values: Span) -> list[MarkRow]:
    """Return the rows of a chart over a range of values."""
    return [
        MarkRow(
            name,
            [mark for each in chart.series if (mark := _mark(chart, each, place, values))],
            values.percent(chart.share[place]) if chart.share else "",
        )
        for place, name in enumerate(chart.names)
    ]


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
    width = short(100 * (high - low) / values.size)
    text += f" ({low:.2f} to {high:.2f})"
    return Mark(series, values.percent(value), text, values.percent(low), width)
