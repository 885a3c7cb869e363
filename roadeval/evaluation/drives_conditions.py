"""Conditions judged over the drives of two fleets; their language is that of results.

``post.filtered.ERR > +0.5pp`` is about the mean over drives of the paired differences, each group
of drives counting alike; with ``surely`` about its interval. ``> 20%`` is about the new fleet's
mean over its own drives. See `roadeval.evaluation.conditions`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from roadeval.evaluation.conditions import OPERATORS, Condition, ConditionError
from roadeval.evaluation.drives_comparison_result import FleetChange, Mask

_Found = TypeVar("_Found")


@dataclass(frozen=True, slots=True)
class FleetLevel:
    """A mask's rates over the new fleet's own drives, as in `FleetChange`."""

    drives: int
    rates: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class FleetJudgement:
    """A condition that was judged over drives.

    Parameters
    ----------
    condition
        The condition.
    before, after
        The rate of the base, NaN for a level, and of the new fleet: means over drives.
    change
        Over drives; NaN for a level.
    low, high
        Its interval, None where there is none.
    drives, clusters
        That tell, and how many groups they are.
    holds
        Whether the condition holds.
    """

    condition: Condition
    before: float
    after: float
    change: float
    low: float | None
    high: float | None
    drives: int
    clusters: int
    holds: bool


def judge_over_drives(
    conditions: Sequence[Condition],
    changes: Sequence[FleetChange],
    levels: Mapping[Mask, FleetLevel],
    *,
    smaller: int,
    scales: tuple[float | None, float | None] = (None, None),
) -> tuple[FleetJudgement, ...]:
    """Judge each condition on the mask that it names.

    Parameters
    ----------
    conditions
        In the order in which they are judged.
    changes
        Of the drives that both fleets have.
    levels
        The new fleet's own.
    smaller
        Scored drives of the smaller fleet: half of them must be in both.
    scales
        At which each fleet was replayed; None where unknown.

    Raises
    ------
    ConditionError
        If a condition asks for what is not there or undefined, for the interval of too few drives,
        or for a change where too few drives are in both fleets or their scales differ.
    """
    masks = {(change.variant, change.stage): change for change in changes}
    return tuple(
        _change(each, _named(each, masks), smaller, scales)
        if each.is_change
        else _level(each, _named(each, levels))
        for each in conditions
    )


def _named(condition: Condition, masks: Mapping[Mask, _Found]) -> _Found:
    mask = condition.variant, condition.stage
    if mask not in masks:
        raise ConditionError(
            f"{condition.text}: nothing compared is called {condition.stage}.{condition.variant}; "
            f"there are {_listed(masks)}"
        )
    return masks[mask]


def _listed(masks: Iterable[Mask]) -> str:
    return ", ".join(sorted(f"{stage}.{variant}" for variant, stage in masks)) or "none"


def _level(condition: Condition, level: FleetLevel) -> FleetJudgement:
    after = level.rates[condition.rate]
    holds = OPERATORS[condition.operator](100 * _defined(condition, after), condition.limit)
    drives = level.drives
    nan = math.nan
    return FleetJudgement(condition, nan, after, nan, None, None, drives, drives, holds)


def _change(
    condition: Condition,
    change: FleetChange,
    smaller: int,
    scales: tuple[float | None, float | None],
) -> FleetJudgement:
    _check_drives(condition, change, smaller, scales)
    before, after = change.base[condition.rate], change.new[condition.rate]
    over = change.difference.get(condition.rate)
    value = _defined(condition, over.mean if over else after - before)
    low, high = (over.low, over.high) if over else (None, None)
    clusters = over.clusters if over else change.drives
    limited = value
    if condition.surely:
        # The end of the interval that is nearest to keeping the limit.
        end = low if condition.operator in (">", ">=") else high
        if end is None:
            needed = over.clusters_needed if over else 0
            raise ConditionError(
                f"{condition.text}: not judged, because {clusters} drives or groups of drives are "
                f"too few for an interval, and {needed} are needed; replay more, or leave out "
                "'surely'"
            )
        limited = end
    holds = OPERATORS[condition.operator](100 * limited, condition.limit)
    drives = over.drives if over else change.drives
    return FleetJudgement(condition, before, after, value, low, high, drives, clusters, holds)


def _check_drives(
    condition: Condition,
    change: FleetChange,
    smaller: int,
    scales: tuple[float | None, float | None],
) -> None:
    base, new = scales
    if base is not None and new is not None and base != new:
        raise ConditionError(
            f"{condition.text}: not judged, because the fleets were replayed with `frames.scale` "
            f"{base:g} and {new:g}; replay both at one scale, or limit in %"
        )
    if 2 * change.drives < smaller:
        raise ConditionError(
            f"{condition.text}: not judged, because both fleets have {change.drives} drives in "
            f"common, fewer than half of the {smaller} of the smaller one; replay the same drives"
        )


def _defined(condition: Condition, value: float) -> float:
    if math.isnan(value):
        raise ConditionError(f"{condition.text}: undefined over the drives, so not judged")
    return value
