"""The charts of a report: of rates, of differences, and over thresholds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE, Rows
from roadeval.data.result import Cells
from roadeval.data.words import DASH, in_percent
from roadeval.evaluation import score
from roadeval.evaluation.metrics import METRICS, SHORT
from roadeval.evaluation.score import Thresholds, merged
from roadeval.evaluation.stats import Difference
from roadeval.report.blocks import Figure
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
from roadeval.runtime.discovery import found_in

if TYPE_CHECKING:
    from roadeval.evaluation.comparison import Change
    from roadeval.results.facts import Totals


@dataclass(frozen=True)
class OverDrive:
    """A figure of a drive's report."""

    caption: str
    charts: Callable[[Rows], Sequence[Chart]]
    """Return its charts of the rows of ``windows.csv``, any number of variants; or none."""


def figures_over_drive() -> tuple[OverDrive, ...]:
    """Return the paper's figures 3a and 3b, and what the modules of this package add."""
    from roadeval.report import charts

    return (
        OverDrive("The paper's figure 3a: error rate.", lambda rows: over_windows(rows, ["ERR"])),
        OverDrive(
            "The paper's figure 3b: false positive and false negative error rates.",
            lambda rows: over_windows(rows, ["FPR", "FNR"]),
        ),
        OverDrive("Further rates over the drive.", _further_rates),
        *found_in(charts, "FIGURE"),
    )


def _further_rates(windows: Rows) -> list[Chart]:
    """Return a chart of each rate of short tables that the paper's figures lack."""
    further = [name for name in SHORT if name not in ("ERR", "FPR", "FNR")]
    # In results that were made before a metric was added it is undefined everywhere.
    known = [name for name in further if len(windows) and not np.isnan(windows[name]).all()]
    return over_windows(windows, known)


def over_windows(
    windows: Rows, rates: Sequence[str], drawn: Mapping[str, Look] | None = None
) -> list[Chart]:
    """Return a chart a rate: each variant's final mask, window by window."""
    if not len(windows):
        return []
    final = score.finals(windows)
    return _along(final, (final["first_frame"] + final["last_frame"]) / 2, rates, drawn)


def over_frames(
    frames: Rows, rates: Sequence[str], drawn: Mapping[str, Look] | None = None
) -> list[Chart]:
    """Return a chart a rate: each variant's final mask, frame by frame."""
    final = score.finals(frames)
    return _along(final, final["frame"], rates, drawn)


def _along(
    final: Rows, x: Cells, rates: Sequence[str], drawn: Mapping[str, Look] | None = None
) -> list[Chart]:
    """Return a chart a rate of rows that lie at ``x`` along the drive."""
    order = np.argsort(x, kind="stable")
    rows = final.take(order).replace(x=x[order])
    names = final.distinct("variant")
    drawn = drawn or looks(names)
    return [
        Chart(
            f"{rate}: {score.SIGNS[rate] if rate in score.SIGNS else METRICS[rate].in_words}",
            ChartKind.LINES,
            [
                thinned(series(name, look, own["x"], 100 * own[rate]))
                for name, look in drawn.items()
                if name in names
                for own in [rows.of_variant(name)]
            ],
            from_zero=rate in score.SIGNS or not METRICS[rate].higher_is_better,
        )
        for rate in rates
    ]


def stages(totals: Totals) -> list[Chart]:
    """Return a chart a rate: each stage's mask, a line a variant."""
    names = merged(own for variant, own in totals.items() if variant != BASELINE)
    return [
        Chart(
            f"{rate}: {metric.in_words}",
            ChartKind.LINES,
            [
                _of_stages(variant, look, totals[variant], names, rate)
                for variant, look in looks([*totals]).items()
            ],
            names=names,
            from_zero=not metric.higher_is_better,
        )
        for rate, metric in SHORT.items()
    ]


def _of_stages(
    variant: str, look: Look, own: Mapping[str, Mapping[str, Any]], names: Sequence[str], rate: str
) -> Series:
    """Return a variant's rate by stage; of the baseline, which has no stages, a level."""
    if variant == BASELINE:
        (total,) = own.values()
        return series(variant, look, range(len(names)), [in_percent(total.get(rate))] * len(names))
    values = [in_percent(total.get(rate)) for total in own.values()]
    return series(variant, look, [names.index(stage) for stage in own], values)


_OF_REGIONS: Final = {"ERR": "ERR within the region", "errors": "Share of the wrong pixels"}


def regions(
    found: Mapping[tuple[str, str], Mapping[str, float]],
    variants: Sequence[str],
    titles: Mapping[str, str],
) -> list[Chart]:
    """Return the error rate in each region, and its share of the errors beside that of pixels.

    ``found`` is as `roadeval.evaluation.score.by_region` returns it. Drawn are the ``variants`` and
    the regions of ``titles``, from top to bottom.
    """

    def column(name: str, variant: str) -> list[float]:
        return [in_percent(found.get((region, variant), {}).get(name)) for region in titles]

    return [
        Chart(
            title,
            ChartKind.MARKS,
            [
                series(variant, look, range(len(titles)), column(name, variant))
                for variant, look in looks(variants).items()
            ],
            names=[*titles.values()],
            share=column("pixels", variants[0]) if name == "errors" else (),
        )
        for name, title in _OF_REGIONS.items()
    ]


def trimap(found: Mapping[str, Mapping[str, Sequence[int]]]) -> Chart:
    """Return ERR by width around the edge: ``found`` are wrong and labelled pixels, by variant."""
    drawn = []
    for name, look in looks([*found]).items():
        shares = [100 * wrong / (labelled or math.nan) for wrong, labelled in found[name].values()]
        drawn.append(series(name, look, range(len(shares)), shares))
    names = [*next(iter(found.values()))]
    return Chart("ERR within so many pixels of the edge", ChartKind.LINES, drawn, names)


def in_metres(name: str) -> str:
    """Return the name of a distance, or of a band of it, for people, as ``20 m``."""
    return name.replace("-", DASH).replace("m", " m")


def by_distance(found: Mapping[tuple[str, str], Interval], variants: Sequence[str]) -> Chart:
    """Return the error rate by distance ahead, with intervals: by region and variant.

    Each variant has a row of its own in each band.
    """
    bands = list(dict.fromkeys(band for band, _ in found))
    drawn, step = looks(variants), len(variants)
    return Chart(
        "ERR by distance ahead",
        ChartKind.MARKS,
        [
            _intervals(
                *(name, drawn[name], range(place, step * len(bands), step)),
                [found.get((band, name), (None, None, None)) for band in bands],
            )
            for place, name in enumerate(variants)
        ],
        names=[name for band in bands for name in (in_metres(band), *[""] * (step - 1))],
    )


def series(name: str, look: Look, x: Any, y: Any) -> Series:
    """Return a series of any numbers."""
    return Series(name, look, [float(each) for each in x], np.asarray(y, float).tolist())


MEAN: Final = "mean over drives"
DRAWN: Final = 40
"""Drives that have a row; of more the worst and the best."""
Interval = tuple[float | None, float | None, float | None]
"""A mean and the ends of its interval, as fractions."""


def difference(
    frames: Cells, changes: Cells, treated: str, control: str, mean: Difference
) -> Chart:
    """Return the paired difference of ERR, frame by frame, and its mean with the interval."""
    look = looks([treated, control])[treated]
    return Chart(
        f"ERR of {treated} minus {control}",
        ChartKind.LINES,
        [thinned(series("each frame", look, frames, 100 * changes))],
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


@dataclass(frozen=True)
class ForestRow:
    """A drive's difference as a fraction; lower is better."""

    name: str
    group: str | None
    mean: float
    low: float | None
    high: float | None
    """Ends of its interval, or None."""


def forest(rows: Sequence[ForestRow], over: Difference, label: str) -> Figure:
    """Return every drive's difference with its interval, the worst first, and that over drives.

    Of many drives only the worst and the best.
    """
    ranked = sorted(rows, key=lambda row: (-row.mean, row.name))
    told = ["A row a drive, with its own interval, the worst above."]
    if len(rows) > DRAWN:
        rows = ranked = ranked[: DRAWN // 2] + ranked[-DRAWN // 2 :]
        told.append(f"Of all drives the {DRAWN // 2} worst and the {DRAWN // 2} best.")
    names = [row.name if row.group is None else f"{row.name} ({row.group})" for row in ranked]
    drives = [
        _intervals(word, look, own, [(r.mean, r.low, r.high) for r in (ranked[p] for p in own)])
        for word, look, own in (
            ("worse", Look(WORSE), [p for p, row in enumerate(ranked) if row.mean > 0]),
            ("better", Look(BETTER), [p for p, row in enumerate(ranked) if row.mean <= 0]),
        )
    ]
    drives.append(
        _intervals(
            MEAN, Look(FAINT, mark="diamond"), [len(ranked)], [(over.mean, over.low, over.high)]
        )
    )
    chart = Chart(label, ChartKind.MARKS, drives, [*names, MEAN], "pp", sums=1)
    if any(row.group for row in rows):
        told.append("In brackets the group that it belongs to.")
    if missing := sum(row.low is None for row in rows):
        told.append(f"{missing} drive{' has' if missing == 1 else 's have'} no interval.")
    if over.low is None:
        told.append("The mean has no interval: too few drives or groups of drives.")
    return Figure([chart], " ".join(told))


def _intervals(
    name: str,
    look: Look,
    places: Sequence[int],
    found: Sequence[Interval],
) -> Series:
    """Return means and the ends of their intervals, all as fractions, as a series."""
    columns = ([in_percent(each) for each in column] for column in zip(*found, strict=True))
    mean, low, high = columns if found else ([], (), ())
    return Series(name, look, [*places], mean, low, high)


LEAST_AXIS: Final = 50
"""Percent at which axes begin, unless a mask lies lower."""
STEP: Final = 10
"""Percent by which they are widened."""
MOST: Final = 101.0
"""Percent at which axes end, so that a line along the edge is seen."""


BINS: Final = 16
"""Parts of the range of probabilities in a chart of reliability."""


def reliability(levels: Rows, totals: Totals) -> Chart:
    """Return the share of road among the pixels that are called so probable, a line a variant.

    Arguments are as of `precision_over_recall`.
    """
    drawn = looks([*totals])
    lines = [series("as it says", Look(FAINT, "dotted"), [0, 100], [0, 100])]
    for (name, _), places in levels.groups("variant", "stage"):
        rows = levels.take(places)
        pixels = rows["other"] + rows["road"]
        part = rows["level"] * BINS // score.LEVELS
        stated = rows["level"] / (score.LEVELS - 1) * pixels
        sums = (np.bincount(part, each, BINS) for each in (pixels, stated, rows["road"]))
        count, said, road = (own[np.unique(part)] for own in sums)
        lines.append(series(name, drawn[name], 100 * said / count, 100 * road / count))
    ends = (0.0, MOST)
    title, across = "share that is road", "probability of road"
    return Chart(title, ChartKind.LINES, lines, across=across, x_range=ends, y_range=ends)


def precision_over_recall(levels: Rows, totals: Totals) -> Chart:
    """Return a curve for each variant that says how probable road is, and a mark for each mask.

    ``levels`` are as in ``probabilities.csv``, ``totals`` as in ``summary.json``. Axes begin where
    the masks lie.
    """
    drawn, curves = looks([*totals]), []
    for (name, _), places in levels.groups("variant", "stage"):
        rows = levels.take(places)
        found = Thresholds.of(np.stack([rows["other"], rows["road"]]))
        if found.road:
            curves.append(series(name, drawn[name], 100 * found.recall, 100 * found.precision))
    masks = {}
    for name, stages in totals.items():
        *_, total = stages.values()
        at = in_percent(total["pooled_TPR"]), in_percent(score.overlap(total)["precision"])
        if all(map(math.isfinite, at)):
            masks[name] = at
    marks = [series(f"{name}: the mask", drawn[name], [x], [y]) for name, (x, y) in masks.items()]
    least = [min([LEAST_AXIS, *values]) for values in zip(*masks.values(), strict=True)]
    across, up = ((each // STEP * STEP, MOST) for each in least or [LEAST_AXIS] * 2)
    drawings, lines = [*curves, *marks], ChartKind.LINES
    return Chart("precision", lines, drawings, across="recall", x_range=across, y_range=up)
