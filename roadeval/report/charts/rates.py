"""Charts of rates: over the drive, by stage, by region, and over the image."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE, Rows, colours
from roadeval.data.rows import Cells
from roadeval.data.words import in_percent
from roadeval.evaluation import score
from roadeval.evaluation.metrics import METRICS, SHORT
from roadeval.evaluation.score import merged
from roadeval.report.chart import Chart, ChartKind, HeatMap, Look, Series, looks, thinned
from roadeval.runtime.discovery import found_in

if TYPE_CHECKING:
    from roadeval.report.findings import ErrorHeatmap
    from roadeval.results.facts import Totals

LEAST_SHARE: Final = 1.0
"""Percent of the frames to which a heat map's shades reach at least."""


# --- Over the drive -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
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
            f"{rate}: {METRICS[rate].in_words}",
            ChartKind.LINES,
            [
                thinned(series(name, look, own["x"], 100 * own[rate]))
                for name, look in drawn.items()
                if name in names
                for own in [rows.of_variant(name)]
            ],
            from_zero=not METRICS[rate].higher_is_better,
        )
        for rate in rates
    ]


def coverage(shares: Mapping[str, Mapping[int, float]]) -> Chart:
    """Return the share of the image that each variant calls road, by frame."""
    return Chart(
        "Share of the image called road",
        ChartKind.LINES,
        [
            thinned(series(name, look, shares[name], 100 * np.array([*shares[name].values()])))
            for name, look in looks([*shares]).items()
        ],
    )


# --- By stage, by region, over the image ----------------------------------------------------------


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

    Parameters
    ----------
    found
        See `roadeval.evaluation.score.by_region`.
    variants
        Those to draw, in order.
    titles
        The regions to draw, from top to bottom, with their titles.
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
        for name, title in (
            ("ERR", "ERR within the region"),
            ("errors", "Share of the wrong pixels"),
        )
    ]


def heat(maps: Sequence[ErrorHeatmap]) -> Iterator[HeatMap]:
    """Yield where each variant has false positives and negatives; equal shades are equal shares."""
    fp, fn = (
        100 * max([float(np.nan_to_num(share).max()) for share in shares] or [0.0])
        for shares in ([each.fp for each in maps], [each.fn for each in maps])
    )
    for each in maps:
        for outcome, shares, top, colour in (
            ("FP", each.fp, fp, colours.FP),
            ("FN", each.fn, fn, colours.FN),
        ):
            title = f"{outcome} of {each.variant}"
            yield HeatMap(title, 100 * shares, max(top, LEAST_SHARE), colour)


def series(name: str, look: Look, x: Any, y: Any) -> Series:
    """Return a series of any numbers."""
    return Series(name, look, [float(each) for each in x], np.asarray(y, float).tolist())
