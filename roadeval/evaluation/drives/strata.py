"""Parts of a fleet: by the value of a tag, and by thirds of a measured condition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from roadeval.evaluation.corrections import holm_p_values
from roadeval.evaluation.drives.across import AcrossDrives, across_drives
from roadeval.evaluation.drives.effect import DriveEffect
from roadeval.evaluation.drives.settings import AcrossSettings


class Third(StrEnum):
    """A third of the fleet's drives by a measured condition."""

    LOW = "low"
    MIDDLE = "middle"
    HIGH = "high"


@dataclass(frozen=True, slots=True)
class Stratum:
    """A part of a fleet, summed up.

    Parameters
    ----------
    by
        The tag or the condition.
    value
        The tag's, or the `Third`.
    least, most
        The condition's least and greatest value in it; None for a tag.
    across
        Its drives, summed up.
    p_holm
        Its p-value after Holm's correction over all strata that were made together; None without a
        p-value, or where every drive's difference is 0.
    comparisons
        How many were corrected for; None where `p_holm` is.
    """

    by: str
    value: str
    least: float | None
    most: float | None
    across: AcrossDrives
    p_holm: float | None = None
    comparisons: int | None = None


def strata(
    effects: Sequence[DriveEffect],
    tags: Mapping[str, Sequence[str | None]],
    conditions: Mapping[str, Sequence[float | None]],
    settings: AcrossSettings,
    *,
    higher_is_better: bool = False,
) -> list[Stratum]:
    """Divide drives by each tag and each condition, and sum up every part.

    A tag or a condition that does not divide the drives makes no parts.

    Parameters
    ----------
    effects
        One a drive. Those without a mean are left out.
    tags, conditions
        By name: each drive's value, in the order of ``effects``; None (or NaN) where it has none,
        which leaves the drive out of this division. A condition's thirds are of the drives that
        have it; drives of one value stay together, so that thirds may differ in size.
    settings, higher_is_better
        As in `across_drives`.

    Returns
    -------
    list of Stratum
        Tags first, in the order given, their values sorted; thirds from low to high.
    """
    known = [place for place, each in enumerate(effects) if not np.isnan(each.mean)]
    parts = [part for by, values in tags.items() for part in _by_value(by, values, known)]
    for by, measured in conditions.items():
        parts += _by_third(by, measured, known)
    made = []
    for part in parts:
        own = [effects[place] for place in part.places]
        across = across_drives(own, settings, higher_is_better=higher_is_better)
        made.append(Stratum(part.by, part.value, part.least, part.most, across))
    return _corrected(made)


@dataclass(frozen=True, slots=True)
class _Part:
    """Which drives a stratum has."""

    by: str
    value: str
    least: float | None
    most: float | None
    places: Sequence[int]


def _by_value(by: str, values: Sequence[str | None], known: Sequence[int]) -> list[_Part]:
    """Return the drives of each value of a tag."""
    by_value: dict[str, list[int]] = {}
    for place in known:
        value = values[place]
        if value is not None:
            by_value.setdefault(value, []).append(place)
    if len(by_value) == 1 and len(*by_value.values()) == len(known):
        return []
    return [_Part(by, value, None, None, places) for value, places in sorted(by_value.items())]


def _by_third(by: str, values: Sequence[float | None], known: Sequence[int]) -> list[_Part]:
    """Return the drives of each third of a condition."""
    measured = np.array([np.nan if values[place] is None else values[place] for place in known])
    measured = measured.astype(np.float64)
    if not np.isfinite(measured).any():
        return []
    cuts = np.quantile(measured[np.isfinite(measured)], [1 / 3, 2 / 3])
    # A value on a cut is below it.
    number = np.where(np.isfinite(measured), np.searchsorted(cuts, measured, side="left"), -1)
    parts = []
    for third, value in enumerate(Third):
        own = np.flatnonzero(number == third)
        if len(own):
            ends = float(measured[own].min()), float(measured[own].max())
            parts.append(_Part(by, value, *ends, [known[place] for place in own.tolist()]))
    return parts if len(parts) > 1 else []


def _corrected(made: Sequence[Stratum]) -> list[Stratum]:
    """Correct the p-values for the number of strata in which something can be found."""
    values = [None if each.across.low == each.across.high == 0 else each.across.p for each in made]
    comparisons = sum(p is not None for p in values)
    return [
        each if p is None else replace(each, p_holm=p, comparisons=comparisons)
        for each, p in zip(made, holm_p_values(values), strict=True)
    ]
