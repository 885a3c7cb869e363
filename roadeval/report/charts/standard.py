"""The charts of a report: of rates, of differences, and over thresholds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE
from roadeval.data.arrays import Floats
from roadeval.data.words import DASH, in_percent
from roadeval.evaluation.metrics import METRICS, SHORT, TESTED
from roadeval.evaluation.score.thresholds import LEVELS, Thresholds
from roadeval.evaluation.score.unlabelled import SIGNS
from roadeval.evaluation.stats.difference import Difference
from roadeval.evaluation.tables import MASK, finals, group_rows, merge_names, only, values_of
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
from roadeval.runtime.discovery import collect

if TYPE_CHECKING:
    import pandas as pd

    from roadeval.evaluation.comparison.compare import MaskChange
    from roadeval.results.facts import Totals


@dataclass(frozen=True)
class OverDrive:
    """A figure of a drive's report."""

    caption: str
    charts: Callable[[pd.DataFrame], Sequence[Chart]]
    """Return its charts of the rows of ``windows.csv``, any number of variants; or none."""


def figures_over_drive() -> tuple[OverDrive, ...]:
    """Return the paper's figures 3a and 3b, and what the modules of this package add."""
    from roadeval.report import charts

    return (
        OverDrive("The paper's figure 3a: error rate.", lambda rows: over_windows(rows, [TESTED])),
        OverDrive(
            "The paper's figure 3b: false positive and false negative error rates.",
            lambda rows: over_windows(rows, ["FPR", "FNR"]),
        ),
        OverDrive("Further rates over the drive.", _further_rates),
        *collect(charts, "FIGURE"),
    )


def _further_rates(windows: pd.DataFrame) -> list[Chart]:
    """Return a chart of each rate of short tables that the paper's figures lack."""
    further = [name for name in SHORT if name not in (TESTED, "FPR", "FNR")]
    # In results that were made before a metric was added it is undefined everywhere.
    return over_windows(windows, [name for name in further if windows[name].notna().any()])


def over_windows(
    windows: pd.DataFrame, rates: Sequence[str], drawn: Mapping[str, Look] | None = None
) -> list[Chart]:
    """Return a chart a rate: each variant's final mask, window by window."""
    middles = (windows["first_frame"] + windows["last_frame"]) / 2
    return over_frames(windows.assign(frame=middles), rates, drawn)


def over_frames(
    frames: pd.DataFrame, rates: Sequence[str], drawn: Mapping[str, Look] | None = None
) -> list[Chart]:
    """Return a chart a rate: each variant's final mask, frame by frame."""
    if not len(frames):
        return []
    rows = finals(frames)
    drawn = drawn or looks(values_of(rows, "variant"))
    rows = rows.sort_values("frame", kind="stable")
    parts = {name: only(rows, variant=name) for name in drawn}
    return [
        Chart(
            f"{rate}: {SIGNS[rate] if rate in SIGNS else METRICS[rate].in_words}",
            ChartKind.LINES,
            [
                thinned(series(name, drawn[name], own["frame"], 100 * own[rate]))
                for name, own in parts.items()
                if len(own)
            ],
            from_zero=rate in SIGNS or not METRICS[rate].higher_is_better,
        )
        for rate in rates
    ]


def stages(totals: Totals) -> list[Chart]:
    """Return a chart a rate: each stage's mask, a line a variant."""
    names = merge_names(own for variant, own in totals.items() if variant != BASELINE)

    def line(variant: str, look: Look, rate: str) -> Series:
        own = {stage: in_percent(total.get(rate)) for stage, total in totals[variant].items()}
        if variant == BASELINE:  # it has no stages: a level
            own = dict.fromkeys(names, *own.values())
        return series(variant, look, map(names.index, own), [*own.values()])

    return [
        Chart(
            f"{rate}: {metric.in_words}",
            ChartKind.LINES,
            [line(variant, look, rate) for variant, look in looks([*totals]).items()],
            names=names,
            from_zero=not metric.higher_is_better,
        )
        for rate, metric in SHORT.items()
    ]


_OF_REGIONS: Final = ("ERR within the region", "Share of the wrong pixels")


def regions(rates: pd.DataFrame, variants: Sequence[str], titles: Mapping[str, str]) -> list[Chart]:
    """Return the error rate in each region, and its share of the errors beside that of pixels.

    ``rates`` are as of `roadeval.evaluation.tables.by_region`. Drawn are the ``variants`` and the
    regions of ``titles``, from top to bottom.
    """
    names, rates = rates.index.get_level_values("variant"), 100 * rates.droplevel("variant")
    percents = {variant: rates[names == variant].reindex([*titles]) for variant in variants}
    return [
        Chart(
            title,
            ChartKind.MARKS,
            [
                series(variant, look, range(len(titles)), percents[variant][rate])
                for variant, look in looks(variants).items()
            ],
            names=[*titles.values()],
            share=percents[variants[0]]["pixels"].tolist() if rate == "errors" else (),
        )
        for rate, title in zip((TESTED, "errors"), _OF_REGIONS, strict=True)
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


def difference(pairs: pd.DataFrame, treated: str, control: str, mean: Difference) -> Chart:
    """Return the paired difference of ERR, frame by frame, and its mean with the interval.

    ``pairs`` are as of `roadeval.evaluation.tables.changes`.
    """
    look = looks([treated, control])[treated]
    return Chart(
        f"ERR of {treated} minus {control}",
        ChartKind.LINES,
        [thinned(series("each frame", look, pairs["frame"], 100 * pairs["change"]))],
        unit="pp",
        level=Level(
            "mean" if mean.low is None else "mean and its interval",
            *map(in_percent, (mean.mean, mean.low, mean.high)),
        ),
    )


def changes(finals: Sequence[MaskChange]) -> list[Chart]:
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


def forest(drives: pd.DataFrame, over: Difference, label: str) -> Figure:
    """Return every drive's difference with its interval, the worst first, and that over drives.

    ``drives`` has a row a drive: its ``name`` and ``group``, and the ``mean``, ``low`` and ``high``
    of its difference as fractions; lower is better. Of many only the worst and the best are drawn.
    """
    ranked = drives.sort_values(["mean", "name"], ascending=[False, True])
    told = ["A row a drive, with its own interval, the worst above."]
    if len(ranked) > DRAWN:
        half = DRAWN // 2
        ranked = ranked.iloc[[*range(half), *range(-half, 0)]]
        told.append(f"Of all drives the {half} worst and the {half} best.")
    groups = ranked["group"].astype(object).fillna("")
    rows = zip(ranked["name"], groups, strict=True)
    names = [f"{name} ({group})" if group else name for name, group in rows]
    is_worse, ends = (ranked["mean"] > 0).to_numpy(), ranked[["mean", "low", "high"]].to_numpy()
    shown = [
        _intervals(word, look, np.flatnonzero(own).tolist(), ends[own])
        for word, look, own in (
            ("worse", Look(WORSE), is_worse),
            ("better", Look(BETTER), ~is_worse),
        )
    ]
    mean = [(over.mean, over.low, over.high)]
    shown.append(_intervals(MEAN, Look(FAINT, mark="diamond"), [len(ranked)], mean))
    chart = Chart(label, ChartKind.MARKS, shown, [*names, MEAN], "pp", sums=1)
    if (groups != "").any():
        told.append("In brackets the group that it belongs to.")
    if missing := ranked["low"].isna().sum():
        told.append(f"{missing} drive{' has' if missing == 1 else 's have'} no interval.")
    if over.low is None:
        told.append("The mean has no interval: too few drives or groups of drives.")
    return Figure([chart], " ".join(told))


def _intervals(
    name: str, look: Look, places: Sequence[int], means: Sequence[Interval] | Floats
) -> Series:
    """Return means and the ends of their intervals, all as fractions, as a series."""
    mean, low, high = (100 * np.array([*means], float).reshape(-1, 3)).T.tolist()
    return Series(name, look, [*places], mean, low, high)


LEAST_AXIS: Final = 50
"""Percent at which axes begin, unless a mask lies lower."""
STEP: Final = 10
"""Percent by which they are widened."""
MOST: Final = 101.0
"""Percent at which axes end, so that a line along the edge is seen."""


BINS: Final = 16
"""Parts of the range of probabilities in a chart of reliability."""


def reliability(levels: pd.DataFrame, totals: Totals) -> Chart:
    """Return the share of road among the pixels that are called so probable, a line a variant.

    Arguments are as of `precision_over_recall`.
    """
    drawn = looks([*totals])
    lines = [series("as it says", Look(FAINT, "dotted"), [0, 100], [0, 100])]
    for (name, _), rows in group_rows(levels, MASK):
        pixels = rows["other"] + rows["road"]
        stated = rows["level"] / (LEVELS - 1) * pixels
        sums = rows.assign(pixels=pixels, stated=stated).groupby(rows["level"] * BINS // LEVELS)
        count, said, road = (sums[column].sum() for column in ("pixels", "stated", "road"))
        lines.append(series(name, drawn[name], 100 * said / count, 100 * road / count))
    ends = (0.0, MOST)
    title, across = "share that is road", "probability of road"
    return Chart(title, ChartKind.LINES, lines, across=across, x_range=ends, y_range=ends)


def precision_over_recall(levels: pd.DataFrame, totals: Totals) -> Chart:
    """Return a curve for each variant that says how probable road is, and a mark for each mask.

    ``levels`` are as in ``probabilities.csv``, ``totals`` as in ``summary.json``. Axes begin where
    the masks lie.
    """
    drawn, curves = looks([*totals]), []
    for (name, _), rows in group_rows(levels, MASK):
        curve = Thresholds.of(rows[["other", "road"]].to_numpy().T)
        if curve.road:
            curves.append(series(name, drawn[name], 100 * curve.recall, 100 * curve.precision))
    masks = {}
    for name, stages in totals.items():
        *_, total = stages.values()
        at = in_percent(total["pooled_TPR"]), in_percent(total.get("pooled_precision"))
        if all(map(math.isfinite, at)):
            masks[name] = at
    marks = [series(f"{name}: the mask", drawn[name], [x], [y]) for name, (x, y) in masks.items()]
    least = [min([LEAST_AXIS, *values]) for values in zip(*masks.values(), strict=True)]
    across, up = ((each // STEP * STEP, MOST) for each in least or [LEAST_AXIS] * 2)
    lines = [*curves, *marks]
    title, kind = "precision", ChartKind.LINES
    return Chart(title, kind, lines, across="recall", x_range=across, y_range=up)
