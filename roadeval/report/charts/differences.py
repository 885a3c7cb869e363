"""Charts of differences: frame by frame, of results against a base, and drive by drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from roadeval.data.rows import Cells
from roadeval.data.words import in_percent, points
from roadeval.evaluation.metrics import SHORT
from roadeval.evaluation.stats import Difference
from roadeval.report.chart import (
    BETTER,
    FAINT,
    WORSE,
    Chart,
    ChartKind,
    Level,
    Look,
    Series,
    looks,
    thinned,
)
from roadeval.report.charts.rates import series

if TYPE_CHECKING:
    from roadeval.evaluation.comparison import Change

MEAN: Final = "mean over drives"
NAMED: Final = 60
"""More drives than this stand without their names, but for the extremes."""
EXTREMES: Final = 3
"""Drives named at either end, where not all are."""
WIDEST: Final = 0.9
"""The share of the drives' intervals that are seen whole; an axis for all would hide the rest."""
LEAST: Final = 0.001
"""The difference on either side of zero that is shown at least: less may be rounding."""


_Interval = tuple[float | None, float | None, float | None]
"""A mean and the ends of its interval, as fractions."""


def difference(
    frames: Cells, changes: Cells, treated: str, control: str, mean: Difference
) -> Chart:
    """Return the paired difference of ERR, frame by frame, and its mean with the interval."""
    drawn, change = looks([treated, control]), 100 * changes
    return Chart(
        f"ERR of {treated} minus {control}",
        ChartKind.BARS,
        [
            thinned(series(f"{treated} {word}", drawn[name], frames, np.where(own, change, np.nan)))
            for word, name, own in (
                ("worse", control, change > 0),
                ("better", treated, change <= 0),
            )
        ],
        unit="pp",
        level=Level(
            "mean" if mean.low is None else "mean and its interval",
            *map(in_percent, (mean.mean, mean.low, mean.high)),
        ),
    )


def changes(finals: Sequence[Change]) -> list[Chart]:
    """Return each result's changes of rates against the base, a chart a rate."""
    return [
        Chart(
            f"Change of {rate}",
            ChartKind.MARKS,
            [
                _intervals(
                    *("change and its interval", Look(FAINT), range(len(finals))),
                    [(own.mean, own.low, own.high) for own in (r.difference[rate] for r in finals)],
                )
            ],
            names=[row.name for row in finals],
            unit="pp",
        )
        for rate in SHORT
    ]


def levels(finals: Sequence[Change]) -> list[Chart]:
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
                    look,
                    [results.index(row.result) for row in finals if row.variant == variant],
                    [in_percent(row.new[rate]) for row in finals if row.variant == variant],
                )
                for variant, look in looks(variants).items()
            ],
            names=results,
            from_zero=not SHORT[rate].higher_is_better,
        )
        for rate in SHORT
    ]


# --- Drive by drive -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ForestRow:
    """A drive's difference, or the mean over drives, as a fraction; lower is better."""

    name: str
    group: str | None
    mean: float
    low: float | None
    high: float | None
    """Ends of its interval, or None."""


def forest(rows: Sequence[ForestRow], mean: ForestRow, label: str) -> list[Chart]:
    """Return every drive's difference with its interval, the worst first, and their mean.

    Rows with names, as long as they are few; of more drives points side by side.
    """
    ranked = _ranked(rows)
    names = [row.name if row.group is None else f"{row.name} ({row.group})" for row in ranked]
    drives = [
        _intervals(word, look, own, [(r.mean, r.low, r.high) for r in (ranked[p] for p in own)])
        for word, look, own in (
            ("worse", Look(WORSE), [p for p, row in enumerate(ranked) if row.mean > 0]),
            ("better", Look(BETTER), [p for p, row in enumerate(ranked) if row.mean <= 0]),
        )
    ]
    ends = _limits(rows, mean)
    if len(rows) > NAMED:
        level = Level(MEAN, *map(in_percent, (mean.mean, mean.low, mean.high)))
        made = Chart(label, ChartKind.POINTS, drives, names, "pp", level=level)
        return [replace(made, y_range=ends)]
    look, told = Look(FAINT, mark="diamond"), [(mean.mean, mean.low, mean.high)]
    drives.append(_intervals(MEAN, look, [len(ranked)], told))
    made = Chart(label, ChartKind.MARKS, drives, [*names, MEAN], "pp", sums=1)
    return [replace(made, y_range=ends)]


def caption(rows: Sequence[ForestRow], mean: ForestRow) -> str:
    """Return what a chart of drives shows."""
    ranked = _ranked(rows)
    if len(rows) <= NAMED:
        told = ["A row a drive, with its own interval, the worst above."]
        if any(row.group for row in rows):
            told.append("In brackets the group that it belongs to.")
    else:
        told = ["A point a drive, with its own interval, the worst on the left."]
        for word, some in (("worst", ranked[:EXTREMES]), ("best", ranked[: -EXTREMES - 1 : -1])):
            named = (f"{row.name} ({points(row.mean)})" for row in some)
            told.append(f"The {word}: {', '.join(named)}.")
    if missing := sum(row.low is None for row in rows):
        told.append(f"{missing} drive{' has' if missing == 1 else 's have'} no interval.")
    if beyond := cut(rows, mean):
        told.append(f"{beyond} interval{' reaches' if beyond == 1 else 's reach'} beyond the edge.")
    if mean.low is None:
        told.append("The mean has no interval: too few drives or groups of drives.")
    return " ".join(told)


def cut(rows: Sequence[ForestRow], mean: ForestRow) -> int:
    """Count the drives whose interval reaches beyond the chart."""
    low, high = _limits(rows, mean)
    ends = [(row.low, row.high) for row in rows if row.low is not None and row.high is not None]
    return sum(100 * a < low or 100 * b > high for a, b in ends)


def _ranked(rows: Sequence[ForestRow]) -> list[ForestRow]:
    return sorted(rows, key=lambda row: (-row.mean, row.name))


def _limits(rows: Sequence[ForestRow], mean: ForestRow) -> tuple[float, float]:
    """Return the ends of the axis in percentage points: every mean is seen, and most intervals."""
    wanted = [row.mean for row in rows] + [0.0, LEAST, -LEAST]
    wanted += [end for end in (mean.low, mean.high) if end is not None]
    for ends, share in (
        ([row.low for row in rows if row.low is not None], 1 - WIDEST),
        ([row.high for row in rows if row.high is not None], WIDEST),
    ):
        if ends:
            wanted.append(float(np.quantile(ends, share)))
    low, high = 100 * min(wanted), 100 * max(wanted)
    margin = 0.04 * (high - low)
    return low - margin, high + margin


def _intervals(
    name: str,
    look: Look,
    places: Sequence[int],
    found: Sequence[_Interval],
) -> Series:
    """Return means and the ends of their intervals, all as fractions, as a series."""
    columns = ([in_percent(each) for each in column] for column in zip(*found, strict=True))
    return Series(name, look, [*places], *(columns if found else ([],)))
