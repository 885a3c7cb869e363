"""Steps, drifts and outliers of a rate over many runs of the same drives.

Runs are looked at in their order, as if every night had one, and the search starts anew after a
step [1]_. The noise of a run is taken for Student's t with 3 degrees: one run far from all others
is no step unless it is some 40 noises away, two or three runs at a new level are.

References
----------
.. [1] D. M. Hawkins, P. Qiu, C. W. Kang, Journal of Quality Technology 35, 2003, 355-366.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from roadeval.data.arrays import Floats

NIGHTS: Final = 365
CHANCE: Final = 0.05
"""The chance that anything false is named in so many looks."""
LEAST_NOISE: Final = 1e-6
"""Differences of rates below this are rounding."""
MARGIN: Final = 1.0
FEW: Final = 1.0
RECENT: Final = 20


class Step(NamedTuple):
    """A change of the level. Positions are those of runs."""

    kind: str  # "step", "drift" or "outlier"
    before: int  # the first run of the old level
    run: int  # the first run of the new level or of a drift's rise; an outlier's run
    after: int  # the last run of the new level or of a drift's rise, inclusive
    found: int  # the run at which it was found; a look at fewer runs does not name it
    change: float  # new level minus old level


class Trace(NamedTuple):
    """A rate over runs."""

    levels: Floats  # (T,), relative; NaN for a run without a drive in common with earlier ones
    noise: float  # standard deviation of one run's noise
    steps: tuple[Step, ...]


def trace(values: Floats, weights: Floats, family: int = 1) -> Trace:
    """Find the steps, drifts and outliers of a rate over runs.

    Parameters
    ----------
    values
        ``(T, D)``: the mean rate of a drive in a run; NaN if the run lacks the drive.
    weights
        ``(D,)``: how much a drive counts. Drives of one group share a weight.
    family
        Number of series that are searched together.
    """
    odds = math.log(NIGHTS * family / CHANCE)
    steps: list[Step] = []
    levels, jumps = np.full((2, len(values)), math.nan)
    left = np.flatnonzero(~np.isnan(values).all(axis=1))
    seen, anchor = -1, 0.0
    while len(left):
        level, width = _levels(values[left], weights)
        runs, level, width = (
            left[~np.isnan(level)],
            level[~np.isnan(level)],
            width[~np.isnan(level)],
        )
        level += anchor - level[runs <= max(seen, runs[0])].mean()
        levels[runs] = level
        new = runs[1:] > seen
        jumps[runs[1:][new]] = (np.abs(np.diff(level)) / np.hypot(width[1:], width[:-1]))[new]
        end, scale = _alarm(level, width, _scales(jumps, odds)[runs], (odds + MARGIN) * 8 / 3)
        if not scale:
            break
        seen, (place, drifts) = (
            int(runs[end]),
            _change(level[: end + 1], np.maximum(width[: end + 1] * scale, LEAST_NOISE)),
        )
        start = end if drifts else place
        change = float(np.median(level[start : end + 1]) - np.median(level[:place]))
        last = steps[-1] if steps else None
        if place == end < len(runs) - 1 and 2 * (level[end + 1] - level[end] + change) * np.sign(
            change
        ) < abs(change):
            steps.append(Step("outlier", int(runs[0]), seen, seen, seen, change))
            left, anchor = left[left != seen], float(level[:end].mean())
            seen = int(runs[end - 1])
            continue
        if (
            last
            and last.after == runs[0]
            and last.change * change > 0
            and (place == 1 or (drifts and 3 * place <= end))
        ):
            steps[-1] = last._replace(kind="drift", after=int(runs[start]))
        else:
            kind = "drift" if drifts else "step"
            steps.append(Step(kind, int(runs[0]), int(runs[place]), int(runs[start]), seen, change))
        left, anchor = left[left >= runs[start]], float(level[start : end + 1].mean())
    return Trace(levels, float(_scales(jumps, 0)[-1]), tuple(_finish(steps, levels)))


def _finish(steps: list[Step], levels: Floats) -> Iterator[Step]:
    """Yield the steps with the ends of their levels, and with changes over all of their runs."""
    for at, step in enumerate(steps):
        later = [other.run for other in steps[at + 1 :] if other.kind != "outlier"]
        end = later[0] if later else len(levels)
        new = (
            levels[step.run : step.run + 1] if step.kind == "outlier" else levels[step.after : end]
        )
        change = float(np.nanmedian(new) - np.nanmedian(levels[step.before : step.run]))
        yield step._replace(after=end - 1 if step.kind == "step" else step.after, change=change)


def _levels(values: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Return each run's level, relative to the first, and how much its noise is widened.

    Each drive is compared with its own mean over the earlier runs, of rate minus level. With fewer
    drives than usual a run has more noise, as if all noise were the drives'.
    """
    there = ~np.isnan(values)
    rates, weight = np.where(there, values, 0.0), there * weights
    levels, shares = np.full((2, len(values)), math.nan)
    total, count = weight[0] * 0, weight[0] * 0
    for run in range(len(values)):
        paired = weight[run] * (count > 0) if run else weight[0]
        shares[run] = share = paired.sum()
        if share:
            levels[run] = level = (
                paired @ (rates[run] - total / np.maximum(count, 1)) / share if run else 0.0
            )
        else:
            level = np.nanmedian(levels[:run])
        total += (rates[run] - level) * there[run]
        count += there[run]
    usual = np.cumsum(shares) / np.arange(1, len(shares) + 1)
    return levels, np.sqrt(np.maximum(usual / np.maximum(shares, 1e-300), 1))


def _scales(jumps: Floats, odds: float) -> Floats:
    """Return the noise of a run as its past tells it, and last as all do, wider if runs are few.

    ``jumps`` are differences between neighbours, divided by the root of 2 if they have all drives.
    """
    known = ~np.isnan(jumps)
    past, scales = jumps[known], np.zeros(known.sum() + 1)
    for reach in (len(past), RECENT):
        number = np.minimum(np.arange(len(past) + 1), reach)
        within = np.tri(len(scales), len(past), -1) - np.tri(len(scales), len(past), -1 - reach)
        ordered = np.sort(np.where(within > 0, past, math.inf), axis=1)
        place = (0.75 * (number[1:] - 1)).astype(int)
        scales[1:] = np.maximum(scales[1:], ordered[range(1, len(scales)), place])
    scales *= np.exp(FEW * odds / np.maximum(np.arange(len(scales)), 1)) / 1.1503
    scales[0] = 0 if not odds else math.inf
    return scales[np.append(0, np.cumsum(known))]


def _fit(level: Floats, width: Floats) -> tuple[Floats, Floats, Floats]:
    sums = np.cumsum(4 * np.log(1 + ((level[:, None] - level) / width[:, None]) ** 2 / 3), axis=0)
    known = np.tri(len(level), dtype=bool)
    best = np.where(known, sums, math.inf).min(axis=1)
    most = np.maximum.accumulate(sums - best[:, None], axis=0)
    gains = best[1:] + np.where(known[1:], most[:-1] - sums[1:], -math.inf).max(axis=1)
    return sums, best, gains


def _alarm(level: Floats, width: Floats, scales: Floats, limit: float) -> tuple[int, float]:
    """Return the first run at which two levels fit better than one by more than a limit."""
    scales = 1.1 ** np.ceil(np.log(np.maximum(scales, LEAST_NOISE)) / math.log(1.1))
    end, scale = len(level), 0.0
    for tried in dict.fromkeys(scales[1:].tolist()):
        looks = np.flatnonzero(scales[1:end] == tried) + 1
        if len(looks) and math.isfinite(tried):
            top = looks[-1] + 1
            gains = _fit(level[:top], np.maximum(width[:top] * tried, LEAST_NOISE))[2]
            over = looks[gains[looks - 1] > limit]
            if len(over):
                end, scale = int(over[0]), tried
    return end, scale


def _change(level: Floats, width: Floats) -> tuple[int, bool]:
    """Return the place at which the level changes, and whether it drifts from there on.

    Two levels, and one level with a rise to the last run, have a place and two numbers each.
    """
    sums, best, gains = _fit(level, width)
    excess = sums[:-1] - best[:-1, None] - sums[-1]
    place = int(excess.max(axis=1).argmax()) + 1
    rises = np.maximum(np.arange(len(level)) - np.arange(len(level) - 3)[:, None], 0.0)
    weight, losses = np.ones_like(rises) / width**2, np.full(len(rises), math.inf)
    for _ in range(5 if len(rises) else 0):
        mean = (weight * rises).sum(axis=1) / weight.sum(axis=1)
        centred, middle = rises - mean[:, None], weight @ level / weight.sum(axis=1)
        slope = (weight * centred) @ level / (weight * centred**2).sum(axis=1)
        away = ((level - middle[:, None] - slope[:, None] * centred) / width) ** 2
        weight, losses = 1 / (3 + away) / width**2, 4 * np.log(1 + away / 3).sum(axis=1)
    if len(rises) and losses.min() + 2 < best[-1] - gains[-1]:
        return int(losses.argmin()) + 1, True
    return place, False
