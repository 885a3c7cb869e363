"""The numbers of a drive's figures as charts, in percent and percentage points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE, Rows, colours
from roadeval.data.rows import Cells
from roadeval.data.words import in_percent
from roadeval.evaluation import scored
from roadeval.evaluation.analysis import merged
from roadeval.evaluation.metrics import METRICS, SHORT
from roadeval.report.chart import Chart, ChartKind, HeatMap, Level, Series, thinned
from roadeval.report.figures.style import Look, looks
from roadeval.report.shades import SHADES, palette, shaded

if TYPE_CHECKING:
    import pandas as pd

    from roadeval.report.findings import ErrorHeatmap, Totals

LEAST_SHARE: Final = 0.01
"""Of the frames, to which a heat map's shades reach at least."""
STEPS: Final = 32
"""Of the scale that is drawn below a heat map."""


def over_windows(windows: Rows, rates: Sequence[str]) -> list[Chart]:
    """Return a chart a rate: each variant's final mask, window by window."""
    if not len(windows):
        return []
    final = scored.finals(windows)
    return _along(final, (final["first_frame"] + final["last_frame"]) / 2, rates)


def over_frames(frames: Rows, rates: Sequence[str]) -> list[Chart]:
    """Return a chart a rate: each variant's final mask, frame by frame."""
    final = scored.finals(frames)
    return _along(final, final["frame"], rates)


def _along(final: Rows, x: Cells, rates: Sequence[str]) -> list[Chart]:
    """Return a chart a rate of rows that lie at ``x`` along the drive."""
    order = np.argsort(x, kind="stable")
    rows = final.take(order).replace(x=x[order])
    names = final.distinct("variant")
    return [
        Chart(
            f"{rate}: {METRICS[rate].in_words}",
            ChartKind.LINES,
            [
                thinned(_series(name, look, own["x"], 100 * own[rate]))
                for name, look in looks(names).items()
                for own in [rows.of_variant(name)]
            ],
            from_zero=not METRICS[rate].higher_is_better,
        )
        for rate in rates
    ]


def difference(frames: pd.DataFrame, treated: str, control: str, mean: Mapping[str, Any]) -> Chart:
    """Return the paired difference of ERR, frame by frame, and its mean with the interval.

    ``frames`` is indexed by ``frame``; ``mean`` is as in ``summary.json``.
    """
    look = looks([treated, control])
    change = 100 * frames["ERR"]
    return Chart(
        f"ERR of {treated} minus {control}",
        ChartKind.BARS,
        [
            thinned(_series(f"{treated} {word}", look[name], own.index, own))
            for word, name, own in (
                ("worse", control, change.where(change > 0)),
                ("better", treated, change.where(change <= 0)),
            )
        ],
        unit="pp",
        level=Level(
            "mean" if mean["low"] is None else "mean and its interval",
            *(in_percent(mean[name]) for name in ("mean", "low", "high")),
        ),
    )


def coverage(table: pd.DataFrame) -> Chart:
    """Return the share of the image that each variant calls road; ``table`` has a row a frame."""
    return Chart(
        "Share of the image called road",
        ChartKind.LINES,
        [
            thinned(_series(name, look, table.index, 100 * table[name]))
            for name, look in looks(list(table.columns)).items()
        ],
    )


def stages(totals: Totals) -> list[Chart]:
    """Return a chart a rate: each stage's mask, a line a variant."""
    names = merged(own for variant, own in totals.items() if variant != BASELINE)
    return [
        Chart(
            f"{rate}: {metric.in_words}",
            ChartKind.LINES,
            [
                _of_stages(variant, look, totals[variant], names, rate)
                for variant, look in looks(list(totals)).items()
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
        return _series(variant, look, range(len(names)), [in_percent(total.get(rate))] * len(names))
    values = [in_percent(total.get(rate)) for total in own.values()]
    return _series(variant, look, [names.index(stage) for stage in own], values)


def regions(table: pd.DataFrame, variants: Sequence[str], titles: Mapping[str, str]) -> list[Chart]:
    """Return the error rate in each region, and its share of the errors beside that of pixels."""
    rows = {name: table[table["variant"] == name].set_index("region") for name in variants}
    pixels = 100 * rows[variants[0]]["pixels"].reindex([*titles]).to_numpy(float)
    columns = (
        ("ERR", "ERR within the region", ()),
        ("errors", "Share of the wrong pixels", pixels),
    )
    return [
        Chart(
            title,
            ChartKind.MARKS,
            [
                _series(name, look, range(len(titles)), 100 * rows[name][column].reindex([*titles]))
                for name, look in looks(variants).items()
            ],
            names=[*titles.values()],
            share=[float(each) for each in share],
        )
        for column, title, share in columns
    ]


def heat(maps: Sequence[ErrorHeatmap], among: Sequence[ErrorHeatmap]) -> Iterator[HeatMap]:
    """Yield where each variant has false positives and negatives; equal shades are equal shares.

    Parameters
    ----------
    maps
        Those to draw.
    among
        All that the shades are to be compared with.
    """
    tops = tops_of(among)
    for each in maps:
        kinds = (("FP", each.fp, colours.FP), ("FN", each.fn, colours.FN))
        for (outcome, shares, colour), top in zip(kinds, tops, strict=True):
            known = palette(colour, colours.MOST_ERRORS, colours.NEVER_LABELLED)
            steps = known[np.linspace(0, SHADES - 1, STEPS).astype(int)]
            yield HeatMap(
                f"{outcome} of {each.variant}",
                100 * shares,
                100 * top,
                [f"#{bytes(step).hex()}" for step in steps],
                shaded(shares, top, known),
            )


def tops_of(maps: Sequence[ErrorHeatmap]) -> tuple[float, float]:
    """Return the greatest shares of false positives and of false negatives: the darkest shades."""
    fps, fns = (
        [float(np.nan_to_num(share).max()) for share in shares]
        for shares in ([each.fp for each in maps], [each.fn for each in maps])
    )
    return max(*fps, LEAST_SHARE), max(*fns, LEAST_SHARE)


def _series(name: str, look: Look, x: Any, y: Any) -> Series:
    return Series(
        name,
        look.colour,
        [float(each) for each in x],
        [float(each) for each in np.asarray(y, float)],
        # With few dashes a page is read with ease; its values tell the rest.
        dashed=look.hollow or name == BASELINE,
        hollow=look.hollow,
    )
