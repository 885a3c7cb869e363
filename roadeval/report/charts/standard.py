"""The charts of a report: rates, differences, and curves over thresholds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
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
from roadeval.report.captions import caption
from roadeval.report.chart import (
    BETTER,
    FAINT,
    POINTS,
    WORSE,
    Chart,
    ChartKind,
    Level,
    Look,
    Series,
    looks,
    thin,
)
from roadeval.runtime.discovery import collect

if TYPE_CHECKING:
    import pandas as pd

    from roadeval.evaluation.comparison.compare import MaskChange
    from roadeval.results.facts import Totals


@dataclass(frozen=True)
class OverDrive:
    """A figure with charts along the drive."""

    caption: str
    charts: Callable[[pd.DataFrame], Sequence[Chart]]
    """The function that makes the charts from the rows of ``windows.csv``, or none."""


def figures_over_drive() -> tuple[OverDrive, ...]:
    """Return the paper's figures 3a and 3b, further rates, and the `FIGURE` of each module."""
    from roadeval.report import charts

    def further_rates(windows: pd.DataFrame) -> list[Chart]:
        names = (name for name in SHORT if name not in (TESTED, "FPR", "FNR"))
        # A metric that is undefined in every window has no chart.
        return over_windows(windows, [name for name in names if windows[name].notna().any()])

    return (
        OverDrive(caption("figure 3a"), lambda windows: over_windows(windows, [TESTED])),
        OverDrive(caption("figure 3b"), lambda windows: over_windows(windows, ["FPR", "FNR"])),
        OverDrive(caption("further rates"), further_rates),
        *collect(charts, "FIGURE"),
    )


def over_windows(
    windows: pd.DataFrame, rates: Sequence[str], by_variant: Mapping[str, Look] | None = None
) -> list[Chart]:
    """Return a chart for each rate with a line for each variant's final mask, window by window.

    ``rates`` are metrics or signs. To draw a quantity that is derived from one, change its column
    before, and the titles and units of the charts after.
    """
    middles = (windows["first_frame"] + windows["last_frame"]) / 2
    return over_frames(windows.assign(frame=middles), rates, by_variant)


def short_end(windows: pd.DataFrame, most: int = POINTS) -> tuple[int, float, float] | None:
    """Return the number of frames of the last point and its ends; None if it has no fewer frames.

    ``windows`` are drawn as at most ``most`` points, each the mean of neighbours. The ends are
    frame numbers, half a frame outside.
    """
    spans = windows.groupby("window")[["first_frame", "last_frame", "frames"]].agg(
        {"first_frame": "min", "last_frame": "max", "frames": "max"}
    )
    per_point = -(-len(spans) // most)
    last = spans.iloc[(len(spans) - 1) // per_point * per_point :]
    if (frames := int(last["frames"].sum())) >= per_point * spans["frames"].max():
        return None
    return frames, last["first_frame"].min() - 0.5, last["last_frame"].max() + 0.5


def describe_points(windows: pd.DataFrame, most: int = POINTS) -> str:
    """Return a clause on how many frames a point of a chart of ``windows`` stands for."""
    size, per_point = windows["frames"].max(), -(-windows["window"].nunique() // most)
    point = f"{per_point} windows of {size} frames" if per_point > 1 else f"{size} frames"
    short = short_end(windows, most)
    return f"each point is the mean of {point}{f', the last one of {short[0]}' if short else ''}"


def over_frames(
    frames: pd.DataFrame, rates: Sequence[str], by_variant: Mapping[str, Look] | None = None
) -> list[Chart]:
    """Return a chart for each rate with a line for each variant's final mask, frame by frame.

    ``by_variant`` has the variants' looks.
    """
    if not len(frames):
        return []
    rows = finals(frames)
    by_variant = by_variant or looks(values_of(rows, "variant"))
    rows = rows.sort_values("frame", kind="stable")
    parts = {name: only(rows, variant=name) for name in by_variant}
    return [
        Chart(
            f"{rate}: {SIGNS[rate] if rate in SIGNS else METRICS[rate].in_words}",
            ChartKind.LINES,
            [
                thin(series(name, by_variant[name], part["frame"], 100 * part[rate]))
                for name, part in parts.items()
                if len(part)
            ],
            from_zero=rate in SIGNS or not METRICS[rate].higher_is_better,
        )
        for rate in rates
    ]


def ribbons(charts: Sequence[Chart]) -> list[Chart]:
    """Return a low chart for each series of charts along the drive; series of one share a scale."""
    return [
        replace(chart, title=series.name, series=[series], y_range=(0.0, max(most, 1.0)), low=True)
        for chart in charts
        for most in [max((y for s in chart.series for _, y in s.points()), default=1.0)]
        for series in chart.series
    ]


def stages(totals: Totals) -> list[Chart]:
    """Return a chart for each rate with a line for each variant through its stages' masks."""
    names = merge_names(stages for variant, stages in totals.items() if variant != BASELINE)

    def line(variant: str, look: Look, rate: str) -> Series:
        rates = {stage: in_percent(total.get(rate)) for stage, total in totals[variant].items()}
        if variant == BASELINE:  # it has no stages: a level
            rates = dict.fromkeys(names, *rates.values())
        return series(variant, look, map(names.index, rates), [*rates.values()])

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


_OF_REGIONS: Final = {TESTED: "ERR within the region", "errors": "Share of the wrong pixels"}
OF_CLASSES: Final = {
    "false": "Share of the false road",
    "missed": "Share of the missed road beside it",
}


def regions(
    rates: pd.DataFrame,
    variants: Sequence[str],
    titles: Mapping[str, str],
    shown: Mapping[str, str] = _OF_REGIONS,
) -> list[Chart]:
    """Return charts of the error rate in each region, and of its shares of errors and pixels.

    ``rates`` come from `roadeval.evaluation.tables.by_region`, ``shown`` has the titles of the
    columns to draw, and ``titles`` the titles of the regions, from top to bottom.
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
            share=percents[variants[0]]["pixels"].tolist() if rate in ("errors", "false") else (),
        )
        for rate, title in shown.items()
    ]


def trimap(counts: Mapping[str, Mapping[str, Sequence[int]]]) -> Chart:
    """Return a chart of ERR by width around the edge, from counts of wrong and labelled pixels."""
    lines = []
    for name, look in looks([*counts]).items():
        shares = [100 * wrong / (labelled or math.nan) for wrong, labelled in counts[name].values()]
        lines.append(series(name, look, range(len(shares)), shares))
    names = [*next(iter(counts.values()))]
    return Chart("ERR within N pixels of the edge", ChartKind.LINES, lines, names)


def in_metres(name: str) -> str:
    """Return a distance, or a band of distances, for people, such as ``20 m``."""
    return name.replace("-", DASH).replace("m", " m")


def by_distance(errors: Mapping[tuple[str, str], Interval], variants: Sequence[str]) -> Chart:
    """Return a chart of the error rate by distance ahead, with a row for each band and variant."""
    bands = list(dict.fromkeys(band for band, _ in errors))
    by_variant, step = looks(variants), len(variants)
    return Chart(
        "ERR by distance ahead",
        ChartKind.MARKS,
        [
            _intervals(
                *(name, by_variant[name], range(place, step * len(bands), step)),
                [errors.get((band, name), (None, None, None)) for band in bands],
            )
            for place, name in enumerate(variants)
        ],
        names=[name for band in bands for name in (in_metres(band), *[""] * (step - 1))],
    )


def series(name: str, look: Look, x: Any, y: Any) -> Series:
    """Return a series of numbers of any type."""
    return Series(name, look, [*map(float, x)], np.asarray(y, float).tolist())


MEAN: Final = "mean over drives"
DRAWN: Final = 40
"""Greatest number of drives with a row; of more drives only the worst and the best are drawn."""
Interval = tuple[float | None, float | None, float | None]
"""A mean and the ends of its interval, as fractions."""
ends_of: Final = attrgetter("mean", "low", "high")


def difference(pairs: pd.DataFrame, treated: str, control: str, mean: Difference) -> Chart:
    """Return a chart of the paired difference of ERR, frame by frame, and its mean.

    ``pairs`` come from `roadeval.evaluation.tables.changes`; ``mean`` has the interval.
    """
    look = looks([treated, control])[treated]
    return Chart(
        f"ERR of {treated} minus {control}",
        ChartKind.LINES,
        [thin(series("each frame", look, pairs["frame"], 100 * pairs["change"]))],
        unit="points",
        level=Level(
            "mean" if mean.low is None else "mean and its interval", *map(in_percent, ends_of(mean))
        ),
    )


def changes(finals: Sequence[MaskChange]) -> list[Chart]:
    """Return a chart for each rate of each mask's change against the base, with its interval."""
    return [
        Chart(
            f"Change of {rate}",
            ChartKind.MARKS,
            [
                _intervals(
                    *("change and its interval", Look(FAINT), range(len(finals))),
                    [ends_of(row.difference[rate]) for row in finals],
                )
            ],
            names=[row.name for row in finals],
            unit="points",
        )
        for rate in SHORT
    ]


def forest(drives: pd.DataFrame, over: Difference, label: str) -> Figure:
    """Return a chart of each drive's difference with its interval, the worst first, and the mean.

    ``drives`` has a row a drive: its ``name`` and ``group``, and the ``mean``, ``low`` and ``high``
    of its difference as fractions; lower is better. If there are more than `DRAWN` drives, only
    the worst and the best are drawn.
    """
    ranked = drives.sort_values(["mean", "name"], ascending=[False, True])
    sentences = [caption("forest")]
    if len(ranked) > DRAWN:
        half = DRAWN // 2
        ranked = ranked.iloc[[*range(half), *range(-half, 0)]]
        sentences.append(caption("drawn drives", half=half))
    groups = ranked["group"].astype(object).fillna("")
    rows = zip(ranked["name"], groups, strict=True)
    names = [f"{name} ({group})" if group else name for name, group in rows]
    is_worse, ends = (ranked["mean"] > 0).to_numpy(), ranked[["mean", "low", "high"]].to_numpy()
    shown = [
        _intervals(word, look, np.flatnonzero(chosen).tolist(), ends[chosen])
        for word, look, chosen in (
            ("worse", Look(WORSE), is_worse),
            ("better", Look(BETTER), ~is_worse),
        )
    ]
    shown.append(_intervals(MEAN, Look(FAINT, mark="diamond"), [len(ranked)], [ends_of(over)]))
    chart = Chart(label, ChartKind.MARKS, shown, [*names, MEAN], "points", sums=1)
    if (groups != "").any():
        sentences.append(caption("drives in groups"))
    if missing := ranked["low"].isna().sum():
        drives_have = f"{missing} drive{' has' if missing == 1 else 's have'}"
        sentences.append(caption("drives without an interval", drives=drives_have))
    if over.low is None:
        sentences.append(caption("mean without an interval"))
    return Figure([chart], " ".join(sentences))


def _intervals(
    name: str, look: Look, places: Sequence[int], means: Sequence[Interval] | Floats
) -> Series:
    """Return a series in percent of means with the ends of their intervals, as fractions."""
    mean, low, high = (100 * np.array([*means], float).reshape(-1, 3)).T.tolist()
    return Series(name, look, [*places], mean, low, high)


LEAST_AXIS: Final = 50
"""Percent at which axes begin, unless a mask lies lower."""
STEP: Final = 10
"""Percent by which axes are extended to lower masks."""
MOST: Final = 101.0
"""Percent at which axes end, so that a line along the edge is visible."""
BINS: Final = 16
"""Bins of probabilities in a chart of reliability."""


def reliability(levels: pd.DataFrame, totals: Totals) -> Chart:
    """Return a chart of the share of road by stated probability, with a line for each variant.

    For the parameters see `precision_over_recall`.
    """
    by_variant = looks([*totals])
    lines = [series("as it says", Look(FAINT, "dotted"), [0, 100], [0, 100])]
    for (name, _), rows in group_rows(levels, MASK):
        pixels = rows["other"] + rows["road"]
        stated = rows["level"] / (LEVELS - 1) * pixels
        sums = rows.assign(pixels=pixels, stated=stated).groupby(rows["level"] * BINS // LEVELS)
        count, stated, road = (sums[column].sum() for column in ("pixels", "stated", "road"))
        lines.append(series(name, by_variant[name], 100 * stated / count, 100 * road / count))
    ends = (0.0, MOST)
    title, across = "share that is road", "probability of road"
    return Chart(title, ChartKind.LINES, lines, across=across, x_range=ends, y_range=ends)


def precision_over_recall(levels: pd.DataFrame, totals: Totals) -> Chart:
    """Return a chart with a curve for each variant with probabilities, and a mark for each mask.

    ``levels`` are as in ``probabilities.csv``, ``totals`` as in ``summary.json``. Axes begin where
    the masks lie.
    """
    by_variant, curves = looks([*totals]), []
    for (name, _), rows in group_rows(levels, MASK):
        curve = Thresholds.of(rows[["other", "road"]].to_numpy().T)
        if curve.road:
            recall, precision = 100 * curve.recall, 100 * curve.precision
            curves.append(series(name, by_variant[name], recall, precision))
    masks = {}
    for name, stages in totals.items():
        *_, total = stages.values()
        point = in_percent(total["pooled_TPR"]), in_percent(total.get("pooled_precision"))
        if all(map(math.isfinite, point)):
            masks[name] = point
            curves.append(series(f"{name}: the mask", by_variant[name], *([at] for at in point)))
    least = [min([LEAST_AXIS, *values]) for values in zip(*masks.values(), strict=True)]
    across, up = ((start // STEP * STEP, MOST) for start in least or [LEAST_AXIS] * 2)
    title, kind = "precision", ChartKind.LINES
    return Chart(title, kind, curves, across="recall", x_range=across, y_range=up)
