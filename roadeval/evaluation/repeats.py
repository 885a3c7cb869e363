"""How far rates depend on what a training draws: those of trainings with other seeds beside it."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from roadeval.data import FrameResult
from roadeval.evaluation.frame_counts import FrameCounts, GrowingCounts, paired, sum_up
from roadeval.evaluation.maps import Name
from roadeval.evaluation.metrics import COMPARED, METRICS

RateLists = dict[str, list[float]]
"""By rate: its value with each seed, in the order of the seeds."""


class Repeats:
    """The counts of every mask of a drive, with each further seed."""

    def __init__(self) -> None:
        self._counts: defaultdict[int, defaultdict[Name, GrowingCounts]] = defaultdict(
            lambda: defaultdict(GrowingCounts)
        )

    def add(self, position: int, result: FrameResult) -> None:
        """Add the evaluated frame at ``position``, counted from 0."""
        for seed, tallies in result.repeats.items():
            for tally in tallies:
                self._counts[seed][tally.variant, tally.stage].append(position, tally.counts)

    def rates(self, masks: Sequence[FrameCounts]) -> dict[str, Any]:
        """Return the rates with each seed, in their order: first those of ``masks``, the run's own.

        Returns
        -------
        dict
            ``totals``, by variant and stage the mean and the pooled rates; ``difference``, by stage
            the mean paired differences, filtered minus unfiltered. Empty without a further seed.
            A mask that no training has to do with is not in it.
        """
        if not self._counts:
            return {}
        trainings = [_by_name(masks)]
        for _, counts in sorted(self._counts.items()):
            trainings.append({name: own.so_far(*name) for name, own in counts.items()})
        names = [name for name in trainings[0] if name in trainings[-1]]
        totals: dict[str, dict[str, RateLists]] = {}
        for variant, stage in names:
            sums = [sum_up(training[variant, stage].counts) for training in trainings]
            totals.setdefault(variant, {})[stage] = {
                rate: [each[rate] for each in sums] for rate in (*METRICS, *_POOLED)
            }
        return {"totals": totals, "difference": _differences(trainings, names)}


_POOLED = tuple(f"pooled_{name}" for name in METRICS)


def _by_name(masks: Sequence[FrameCounts]) -> dict[Name, FrameCounts]:
    return {(mask.variant, mask.stage): mask for mask in masks}


def _differences(
    trainings: Sequence[Mapping[Name, FrameCounts]], names: Sequence[Name]
) -> dict[str, RateLists]:
    """Return the mean paired differences by stage and rate, one a training."""
    found: dict[str, RateLists] = {}
    for training in trainings:
        for stage, table in paired([training[name] for name in names]):
            for rate, values in zip(METRICS, table.T, strict=True):
                if rate in COMPARED:
                    known = values[~np.isnan(values)]
                    mean = float(known.mean()) if len(known) else math.nan
                    found.setdefault(stage, {}).setdefault(rate, []).append(mean)
    return found
