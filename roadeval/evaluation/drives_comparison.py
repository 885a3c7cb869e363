"""Comparison of two fleets, paired by drive: what changed over all drives, and on which.

A drive's frames are matched by their stamps and its differences averaged, as those of two results
are; over drives, or groups of them, the means are summed up by
`roadeval.evaluation.drives.across_drives`. Which single drives changed is many questions at once:
their p-values are corrected after Benjamini and Hochberg, so that of the drives that are named a
small share on average has not changed.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from roadeval.data import Counts
from roadeval.evaluation import metrics
from roadeval.evaluation.corrections import benjamini_hochberg, holm_p_values
from roadeval.evaluation.drives import (
    AcrossDrives,
    AcrossSettings,
    DriveEffect,
    across_drives,
    strata,
)
from roadeval.evaluation.drives.effect import Clusters
from roadeval.evaluation.drives_comparison_result import (
    TESTED,
    DriveChange,
    DrivePair,
    FleetChange,
    FleetStratum,
    Integers,
    Mask,
    MaskFrames,
    MaskPair,
    Values,
)
from roadeval.evaluation.metrics import COMPARED, METRICS
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import mean_difference

_TESTED_AT: Final = list(METRICS).index(TESTED)


def pair_drive(
    drive: str,
    group: str,
    base: Mapping[Mask, MaskFrames],
    new: Mapping[Mask, MaskFrames],
    *,
    tested: Collection[Mask],
    settings: EvaluationSettings,
) -> DrivePair:
    """Match a drive's frames in two fleets by their stamps, and subtract their rates.

    Parameters
    ----------
    drive, group
        See `DrivePair`.
    base, new
        Its masks in each fleet.
    tested
        The masks whose difference of `TESTED` is given an interval, which takes most of the time.
    settings
        The confidence, and the least number of frames.
    """
    masks, truths = {}, 0
    left = 0, 0
    for mask in (each for each in new if each in base):
        before, after = base[mask], new[mask]
        mine, theirs = matched(before.stamps, after.stamps)
        left = len(before.stamps) - len(mine), len(after.stamps) - len(mine)
        if len(mine):
            counts = before.counts[mine], after.counts[theirs]
            masks[mask] = _pair(*counts, settings, tested=mask in tested)
            truths = max(truths, _other_truths(*counts))
    return DrivePair(drive, group, masks, *left, truths)


def matched(base: Integers, new: Integers) -> tuple[Integers, Integers]:
    """Return the places of the stamps that both have, in the base's order.

    Equal stamps are told apart by their order.

    >>> [places.tolist() for places in matched(np.array([5, 7, 7, 9]), np.array([7, 4, 7, 5]))]
    [[0, 1, 2], [3, 0, 2]]
    """
    if np.array_equal(base, new):
        every = np.arange(len(base))
        return every, every
    _, codes = np.unique(np.concatenate([base, new]), return_inverse=True)
    before, after = (
        codes[part] * (len(codes) + 1) + _occurrences(codes[part])
        for part in (slice(len(base)), slice(len(base), None))
    )
    _, mine, theirs = np.intersect1d(before, after, return_indices=True)
    order = np.argsort(mine)
    return mine[order], theirs[order]


def compare_drives(
    pairs: Sequence[DrivePair], finals: Collection[Mask], settings: AcrossSettings
) -> list[FleetChange]:
    """Sum up what changed over drives, mask by mask in the drives' order.

    Parameters
    ----------
    pairs
        The drives that both fleets have.
    finals
        The masks that are a variant's last one.
    settings
        The confidence, and what an interval needs.
    """
    names = dict.fromkeys(mask for pair in pairs for mask in pair.masks)
    changes = [_change(pairs, mask, mask in finals, settings) for mask in names]
    values = [_testable(change.difference[TESTED]) for change in changes]
    comparisons = sum(p is not None for p in values)
    return [
        change if p is None else replace(change, p_holm=p, comparisons=comparisons)
        for change, p in zip(changes, holm_p_values(values), strict=True)
    ]


def changed_drives(pairs: Sequence[DrivePair], masks: Sequence[Mask]) -> list[DriveChange]:
    """Return every drive's change of ERR, mask by mask, the surest first.

    For each mask the p-values of all its drives are corrected together.
    """
    found = []
    for mask in masks:
        rows = [_drive_change(pair, mask) for pair in pairs if mask in pair.masks]
        values = benjamini_hochberg([row.p for row in rows])
        rows = [replace(row, q=q) for row, q in zip(rows, values, strict=True)]
        found += sorted(rows, key=_surest)
    return found


def change_strata(
    pairs: Sequence[DrivePair],
    masks: Sequence[Mask],
    tags: Mapping[str, Sequence[str | None]],
    settings: AcrossSettings,
) -> list[FleetStratum]:
    """Sum up the changes of ERR by the values of tags, each given in the drives' order."""
    return [
        FleetStratum(*mask, stratum)
        for mask in masks
        for stratum in strata([_effect(pair, mask, TESTED) for pair in pairs], tags, {}, settings)
    ]


def _pair(base: Integers, new: Integers, settings: EvaluationSettings, *, tested: bool) -> MaskPair:
    before, after = metrics.table(base), metrics.table(new)
    column = _TESTED_AT
    difference = mean_difference(after[:, column], before[:, column], settings) if tested else None
    return MaskPair(
        frames=len(base),
        base=_means(before),
        new=_means(after),
        difference=_means(after - before),
        base_counts=base.sum(axis=0),
        new_counts=new.sum(axis=0),
        tested=difference,
    )


def _means(rates: Values) -> Values:
    """Return the mean of each column, ``(m,)``, where it is defined; NaN where it never is."""
    known = ~np.isnan(rates)
    counts = known.sum(axis=0)
    sums = np.where(known, rates, 0).sum(axis=0)
    means: Values = np.divide(sums, counts, out=np.full(len(sums), np.nan), where=counts > 0)
    return means


def _other_truths(base: Integers, new: Integers) -> int:
    """Count the frames with another number of road or labelled pixels, whatever was found."""
    road = base[:, [0, 3]].sum(axis=1) != new[:, [0, 3]].sum(axis=1)
    labelled = base.sum(axis=1) != new.sum(axis=1)
    return int((road | labelled).sum())


def _occurrences(codes: Integers) -> Integers:
    """Return how often each value has come before: 0 at its first place."""
    order = np.argsort(codes, kind="stable")
    ordered = codes[order]
    first = np.searchsorted(ordered, ordered)
    before = np.empty(len(codes), np.int64)
    before[order] = np.arange(len(codes)) - first
    return before


def _change(
    pairs: Sequence[DrivePair], mask: Mask, final: bool, settings: AcrossSettings
) -> FleetChange:
    having = [pair for pair in pairs if mask in pair.masks]
    own = [pair.masks[mask] for pair in having]
    difference = {
        rate: across_drives(
            [_effect(pair, mask, rate, counted=final) for pair in pairs],
            settings,
            higher_is_better=METRICS[rate].higher_is_better,
        )
        for rate in COMPARED
    }
    base = _rates(having, [each.base for each in own], [each.base_counts for each in own])
    new = _rates(having, [each.new for each in own], [each.new_counts for each in own])
    return FleetChange(*mask, final, len(own), base, new, difference)


def _effect(pair: DrivePair, mask: Mask, rate: str, *, counted: bool = False) -> DriveEffect:
    """Return a drive's difference of a rate; with ``counted`` that of ERR has its pixels."""
    own = pair.masks.get(mask)
    if own is None:
        return DriveEffect(pair.drive, pair.group, math.nan, 0)
    mean = float(own.difference[list(METRICS).index(rate)])
    if rate != TESTED:
        return DriveEffect(pair.drive, pair.group, mean, own.frames)
    counts = map(_wrong, (own.base_counts, own.new_counts)) if counted else (None, None)
    return DriveEffect(pair.drive, pair.group, mean, own.frames, *counts)


def _wrong(counts: Integers) -> tuple[int, int]:
    """Return the wrong and the labelled pixels."""
    return int(counts[2:].sum()), int(counts.sum())


def _rates(
    pairs: Sequence[DrivePair], means: Sequence[Values], counts: Sequence[Integers]
) -> dict[str, float]:
    """Return the means over drives, and the rates of all their pixels together."""
    total = Counts(*(int(count) for count in np.sum(counts, axis=0)))
    over = {
        name: _mean_of_groups(pairs, [float(each[place]) for each in means])
        for place, name in enumerate(METRICS)
    }
    pooled = {f"pooled_{name}": value for name, value in metrics.of(total).items()}
    return over | pooled | metrics.overlap(total)


def _mean_of_groups(pairs: Sequence[DrivePair], values: Sequence[float]) -> float:
    """Average drives as their differences are, so that these are what lies between two rates."""
    own = zip(pairs, values, strict=True)
    clusters = Clusters.of(DriveEffect(pair.drive, pair.group, v, 0) for pair, v in own)
    return float(clusters.group_means().mean()) if len(clusters) else math.nan


def _testable(found: AcrossDrives) -> float | None:
    """Return the p-value; None where nothing can be found, for every drive is as it was."""
    return None if found.low == found.high == 0 else found.p


def _drive_change(pair: DrivePair, mask: Mask) -> DriveChange:
    own = pair.masks[mask]
    base, new, mean = (float(x[_TESTED_AT]) for x in (own.base, own.new, own.difference))
    tested = own.tested
    # A drive whose every frame is as it was was tested, too: its p-value is 1.
    low, high, p = (tested.low, tested.high, tested.p) if tested else (None, None, None)
    return DriveChange(pair.drive, *mask, own.frames, base, new, mean, low, high, p, None)


def _surest(row: DriveChange) -> tuple[float, float, str]:
    return (2.0 if row.q is None else row.q, -abs(np.nan_to_num(row.mean)), row.drive)
