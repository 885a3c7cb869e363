"""Many runs over the same drives: which rate changed in which run.

A run is compared with the runs before it on the drives that both have. If a drive's log,
frames or truth change, it is another drive from then on: its numbers describe other pixels.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from roadeval.data.arrays import Floats
from roadeval.evaluation.comparison.compare import MaskChange
from roadeval.evaluation.comparison.conditions import Condition, Judgement
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.regions import ALL, titles
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.autocorrelation import mean_distribution
from roadeval.evaluation.stats.difference import LEAST_GROUPS, Difference, holm, over_drives
from roadeval.evaluation.stats.steps import ChangePoint, trace
from roadeval.evaluation.tables import KEY, group_rows, only, values_of

if TYPE_CHECKING:
    import pandas as pd

PIXELS: Final = ("source", "camera", "log_digest", "truth", "frames", "road", "N")
"""Columns that tell whether two runs scored the same pixels of a drive, see `number_pixels`; the
``source`` is the name of a drive that its log does not tell from others, else empty."""
RATES: Final = (TESTED, "FPR", "FNR")
"""The rates of a whole mask that are searched; of a part of its pixels only the first is."""


class Line(NamedTuple):
    """A rate of a final mask, or of some of its pixels, run by run."""

    variant: str
    stage: str
    """The stage of the final mask."""
    kind: str
    """``all``, ``region``, ``class``, or a tag's name; its column if that is one of the three."""
    part: str
    """The region, the class, or the value of the tag."""
    rate: str
    title: str
    """The rate and its pixels or drives for people, without the variant."""
    rates: Floats
    """``(T,)`` mean over the drives of each run; NaN if it has none."""
    levels: Floats
    """``(T,)`` the mean as if every run had the drives of the last run."""
    ends: Floats
    """``(2, T)`` ends of the interval of each run's mean change over its drives, around the level;
    only for `TESTED` of all pixels, else empty; NaN with too few drives."""
    noise: float
    steps: tuple[ChangePoint, ...]
    drive_rates: Floats
    """``(T, D)`` mean of each drive in each run."""
    drives: pd.DataFrame
    """The name and the group of each drive, and its camera."""


class LineChange(NamedTuple):
    """A step of a line, and the drives that carry it."""

    line: Line
    step: ChangePoint
    difference: Difference
    """Mean after it minus mean before it, over the drives that were there before and after."""
    drives: pd.DataFrame
    """These drives with the means ``before`` and ``after``, the greatest change first."""


def number_pixels(rows: pd.DataFrame) -> pd.Series[int]:
    """Return a number for each row, equal for rows of the same pixels of a drive, see `PIXELS`.

    It is a hash of the row: two rows of different pixels have the same once in 2^64 pairs.
    """
    from pandas.util import hash_pandas_object

    return hash_pandas_object(rows[[*PIXELS]], index=False)


def find_lines(
    rows: pd.DataFrame, tags: Mapping[str, str], count: int, confidence: float
) -> list[Line]:
    """Return the lines of ``count`` runs, with their steps.

    ``rows`` has a row for each ``run`` (its position), drive, camera, variant, ``kind`` and
    ``part`` of the pixels: its rates as fractions, the drive's ``group``, ``pixels`` as
    `number_pixels` has them, and the columns of the drives' tags; ``tags`` has the names of the
    tags by column. All lines are one family, see `roadeval.evaluation.stats.steps`. Intervals
    around levels have this ``confidence``.
    """
    places = {**group_rows(rows, ["variant", "kind", "part"]).indices}
    for column, tag in tags.items():
        tagged = np.flatnonzero((rows["kind"] == ALL) & rows[column].notna())
        by_value = group_rows(rows.iloc[tagged], ["variant", column]).indices
        kind = column if tag in (ALL, "region", "class") else tag
        places |= {(variant, kind, value): tagged[n] for (variant, value), n in by_value.items()}
    searched = [(*map(str, k), n, RATES if k[1] == ALL else RATES[:1]) for k, n in places.items()]
    family = sum(len(rates) for *_, rates in searched)
    regions = titles(values_of(only(rows, kind="region"), "part"))
    lines: list[Line] = []
    for variant, kind, part, numbers, rates in searched:
        part_rows = rows[[*KEY, "run", "pixels", "group", "stage", *rates]].iloc[numbers]
        column, first = part_rows["pixels"].factorize()[0], ~part_rows["pixels"].duplicated()
        drives = part_rows.loc[first, [*KEY, "group"]].astype("str")
        sizes = group_rows(drives.drop_duplicates(), ["group"]).size()
        weights = 1 / drives["group"].map(sizes).to_numpy(float)  # drives of a group share one
        values = np.full((len(rates), count, len(drives)), np.nan)  # NaN if a run lacks a drive
        values[:, part_rows["run"], column] = part_rows[[*rates]].to_numpy().T
        name = {ALL: "", "region": regions.get(part, ""), "class": part}.get(kind, f"{kind} {part}")
        for rate, drive_rates in zip(rates, values, strict=True):
            title = ", ".join(filter(None, (rate, name)))
            about = variant, str(part_rows["stage"].iloc[-1]), kind, part, rate, title
            means, levels, noise, steps = _follow(drive_rates, weights, family)
            ends = np.zeros((0, count))
            if title == TESTED:
                ends = _ends(drive_rates, drives, steps, levels, confidence)
            levels = np.clip(levels, 0, 1)  # other drives may have had lower rates
            lines.append(Line(*about, means, levels, ends, noise, steps, drive_rates, drives))
    return lines


def _follow(
    values: Floats, weights: Floats, family: int
) -> tuple[Floats, Floats, float, tuple[ChangePoint, ...]]:
    """Return the means ``(T,)`` of a rate ``(T, D)``, its levels ``(T,)``, its noise, its steps."""
    there = ~np.isnan(values)
    with np.errstate(invalid="ignore"):
        means = np.where(there, values, 0) @ weights / (there @ weights)
    levels, noise, steps = np.full(len(values), np.nan), 0.0, []
    # A run shares a drive with an earlier run of its stretch. A run without any drive is left out.
    stretches, seen = list[list[int]](), there[0]
    for run in np.flatnonzero(there.any(axis=1)).tolist():
        if not stretches or not (seen & there[run]).any():
            stretches.append([])
            seen = there[run]
        stretches[-1].append(run)
        seen = seen | there[run]
    for runs in stretches:
        traced = trace(values[runs], weights, family)
        levels[runs] = traced.levels - traced.levels[-1] + means[runs[-1]]
        noise = traced.noise
        for step in traced.steps:
            places = [runs[place] for place in step[1:5]]
            steps.append(ChangePoint._make([step.kind, *places, step.change]))
    return means, levels, noise, tuple(steps)


def _ends(
    values: Floats,
    drives: pd.DataFrame,
    steps: Sequence[ChangePoint],
    levels: Floats,
    confidence: float,
) -> Floats:
    """Return the ends, ``(2, T)``, of Student's interval over groups around each run's level.

    It is computed from the drives' changes from their own means since the last step.
    """
    ends, group = np.full((2, len(values)), np.nan), drives["group"].factorize()[0]
    member = group[:, None] == np.unique(group)
    for begin, end in pairwise(sorted({0, *(step.run for step in steps), len(values)})):
        there = ~np.isnan(values[begin:end])
        rates = np.where(there, values[begin:end], 0)
        away = np.where(there, rates - rates.sum(0) / np.maximum(there.sum(0), 1), 0)
        with np.errstate(invalid="ignore"):
            means = (away @ member) / (there @ member)
        for run, of_groups in enumerate(means, begin):
            defined = of_groups[~np.isnan(of_groups)]
            if len(defined) >= LEAST_GROUPS:
                interval = mean_distribution(defined, independent=True).interval(confidence)
                ends[:, run] = levels[run] - defined.mean() + interval
    return ends


Within = Callable[[Line, Sequence[int], Sequence[int]], Difference]
"""Returns a line's difference over the frames of its only drive, from some runs to others."""


def find_changes(lines: Sequence[Line], confidence: float, within: Within) -> list[LineChange]:
    """Return the steps in the order of their runs; p-values of masks' ERR are corrected."""
    changes = []
    for line in lines:
        for step in line.steps:
            last = step.run if step.kind == "outlier" else step.after
            # The end of a drift; its beginning is like the level before.
            first = last - (last - step.run) // 4 if step.kind == "drift" else step.run
            runs = range(step.before, step.run), range(first, last + 1)
            changes.append(LineChange(line, step, *_difference(line, *runs, confidence, within)))
    tested = [n for n, c in enumerate(changes) if (c.line.kind, c.line.rate) == (ALL, TESTED)]
    corrected = holm([changes[place].difference for place in tested])
    for place, difference in zip(tested, corrected, strict=True):
        changes[place] = changes[place]._replace(difference=difference)
    return sorted(changes, key=lambda change: change.step.run)


def _difference(
    line: Line, before: range, after: range, confidence: float, within: Within
) -> tuple[Difference, pd.DataFrame]:
    """Return the change over the drives that have runs before and after, and these drives."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # some drive may be in no run
        # An outlier tells nothing about the level of the runs beside it.
        out = {step.run for step in line.steps if step.kind == "outlier"}
        sides = [[run for run in runs if run not in out] or [*runs] for runs in (before, after)]
        old, new = (np.nanmean(line.drive_rates[runs], axis=0) for runs in sides)
    # Means of equal numbers may differ in their last digit.
    rows = line.drives.assign(before=old, after=new, mean=(new - old).round(12))
    rows = rows[rows["mean"].notna()]
    rows = rows.iloc[np.argsort(-np.abs(rows["mean"].to_numpy()), kind="stable")]
    difference = over_drives(rows, confidence, line.rate)
    if len(rows) == 1 and line.kind == ALL:
        there = ~np.isnan(line.drive_rates[:, line.drives.index == rows.index[0]])
        scored = ([run for run in runs if there[run]] for runs in sides)
        within_it = within(line._replace(drives=rows), *scored)
        difference = difference if math.isnan(within_it.mean) else within_it  # frames may be gone
    return difference, rows


def judge_last(
    lines: Sequence[Line],
    conditions: Sequence[Condition],
    earlier: int,
    settings: EvaluationSettings,
    within: Within,
) -> Iterator[Judgement]:
    """Judge each condition on the last run, against the mean of ``earlier`` runs before it.

    The interval of the change is widened by the noise of a run.
    """
    label = "the last run"
    masks = {
        f"{line.stage}.{line.variant}.{line.rate}": line
        for line in lines
        if line.kind == ALL and not np.isnan(line.rates[-1])
    }
    for condition in conditions:
        name = f"{condition.stage}.{condition.variant}.{condition.rate}"
        if (line := masks.get(name)) is None:
            why = f"it has no {name}; there are {', '.join(masks) or 'none'}"
            yield condition.not_judged(label, why)
            continue
        end = len(line.rates) - 1
        runs = range(max(end - earlier, 0), end), range(end, end + 1)
        difference, rows = _difference(line, *runs, settings.confidence, within)
        if condition.is_change and not len(rows):
            why = f"no drive of it was scored alike in the {earlier} runs before"
            yield condition.not_judged(label, why)
            continue
        if difference.low is not None and difference.high is not None:
            mean, noise = difference.mean, 2 * line.noise * math.sqrt(1 + 1 / len(runs[0]))
            below, above = (math.hypot(mean - b, noise) for b in (difference.low, difference.high))
            difference = replace(difference, low=mean - below, high=mean + above)
        # A change is of the drives that were there before; a rate is of all drives.
        of_groups = rows.groupby("group")["after"].mean()
        new = float(of_groups.mean() if condition.is_change else line.rates[-1])
        base = new - difference.mean
        rate = condition.rate
        about = label, line.variant, line.stage, True, len(rows), settings.least_frames
        mask = MaskChange(*about, {rate: base}, {rate: new}, {rate: difference})
        yield condition.judge(mask)
