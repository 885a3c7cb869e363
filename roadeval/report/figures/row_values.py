"""The numbers of figures with a row a drive or a result as charts, in percent and points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from roadeval.data.words import in_percent
from roadeval.evaluation.metrics import SHORT
from roadeval.evaluation.uncertainty import Difference
from roadeval.report.chart import Chart, ChartKind, Level, Series
from roadeval.report.figures.forest import (
    BETTER,
    NAMED,
    WORSE,
    ForestMean,
    ForestRow,
    limits,
)
from roadeval.report.figures.style import FAINT, looks

if TYPE_CHECKING:
    from roadeval.evaluation.comparison_result import MaskComparison

MEAN: Final = "mean over drives"
CHANGE: Final = FAINT
Interval = ForestRow | ForestMean | Difference
"""A mean, with ends where it has an interval."""


def forest(rows: Sequence[ForestRow], mean: ForestMean, label: str) -> list[Chart]:
    """Return every drive's difference with its interval, the worst first, and their mean.

    Rows with names where the figure names its drives, too; of more drives points side by side.
    """
    ranked = sorted(rows, key=lambda row: (-row.mean, row.name))
    names = [row.name if row.group is None else f"{row.name} ({row.group})" for row in ranked]
    worse = [place for place, row in enumerate(ranked) if row.mean > 0]
    better = [place for place, row in enumerate(ranked) if row.mean <= 0]
    series = [
        _intervals(word, colour, places, [ranked[place] for place in places])
        for word, colour, places in (("worse", WORSE, worse), ("better", BETTER, better))
    ]
    if len(rows) > NAMED:
        ends = limits(rows, mean)
        level = Level(MEAN, *(100 * mean.mean, _end(mean.low), _end(mean.high)))
        drives = Chart(label, ChartKind.POINTS, series, names=names, unit="pp", level=level)
        return [replace(drives, y_range=ends)]
    series.append(_intervals(MEAN, CHANGE, [len(ranked)], [mean]))
    return [Chart(label, ChartKind.MARKS, series, names=[*names, MEAN], unit="pp")]


def changes(finals: Sequence[MaskComparison]) -> list[Chart]:
    """Return each result's changes of rates against the base, a chart a rate."""
    return [
        Chart(
            f"Change of {rate}",
            ChartKind.MARKS,
            [
                _intervals(
                    "change", CHANGE, range(len(finals)), [r.difference[rate] for r in finals]
                )
            ],
            names=[row.name for row in finals],
            unit="pp",
        )
        for rate in SHORT
    ]


def levels(finals: Sequence[MaskComparison]) -> list[Chart]:
    """Return the rates of several results' final masks, a chart a rate."""
    results = list(dict.fromkeys(row.result for row in finals))
    variants = list(dict.fromkeys(row.variant for row in finals))
    return [
        Chart(
            rate,
            ChartKind.MARKS,
            [
                Series(
                    variant,
                    look.colour,
                    [results.index(row.result) for row in finals if row.variant == variant],
                    [in_percent(row.new[rate]) for row in finals if row.variant == variant],
                    hollow=look.hollow,
                )
                for variant, look in looks(variants).items()
            ],
            names=results,
            from_zero=not SHORT[rate].higher_is_better,
        )
        for rate in SHORT
    ]


def _intervals(name: str, colour: str, places: Sequence[int], found: Sequence[Interval]) -> Series:
    return Series(
        name,
        colour,
        [*places],
        [in_percent(each.mean) for each in found],
        [_end(each.low) for each in found],
        [_end(each.high) for each in found],
    )


def _end(value: float | None) -> float:
    return math.nan if value is None else 100 * value
