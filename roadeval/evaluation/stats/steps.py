"""Steps, drifts and outliers of a rate over many runs of the same drives.

Runs are looked at in their order, and the search starts again after a step: D. M. Hawkins, P. Qiu,
C. W. Kang, Journal of Quality Technology 35, 2003, 355-366.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from roadeval.data.arrays import Floats

LEAST_NOISE: Final = 1e-6  # of a rate; less is rounding


class ChangePoint(NamedTuple):
    """A change of the level. Positions are numbers of runs."""

    kind: str  # "step", "drift" or "outlier"
    before: int  # the first run of the old level
    run: int  # the first run of the new level or of a drift's rise; an outlier's run
    after: int  # the last run of the new level or of a drift's rise, inclusive
    alarm: int  # the run at which it is detected; fewer runs do not show it
    change: float  # new level minus old level


class Trace(NamedTuple):
    """A rate over runs."""

    levels: Floats  # (T,), relative; NaN for a run without a drive in common with earlier ones
    noise: float  # standard deviation of one run's noise
    steps: tuple[ChangePoint, ...]


def trace(values: Floats, weights: Floats, family: int = 1) -> Trace:
    """Find the steps, drifts and outliers of a rate over runs.

    ``values`` are the mean rates of drives in runs, ``(T, D)``, NaN if a run lacks a drive;
    ``weights``, ``(D,)``, say how much a drive counts; ``family`` series are searched together.

    A run detects a step if two levels fit better than one by h = ``8 / 3 log(365 family / 0.05)``
    in twice the log-likelihood of Student's t with 3 degrees. One run some 33 noises off reaches
    that; by chance a run does so at a rate of about ``exp(-3 h / 8)``, see ``benchmarks.history``.
    """
    odds, steps = math.log(365 * family / 0.05), list[ChangePoint]()
    levels, jumps = np.full((2, len(values)), math.nan)
    left = np.flatnonzero(~np.isnan(values).all(axis=1))
    seen, anchor = -1, 0.0
    while len(left):
        level, width = _levels(values[left], weights)
        runs = left[~np.isnan(level)]
        level, width = level[~np.isnan(level)], width[~np.isnan(level)]
        level += anchor - level[runs <= max(seen, runs[0])].mean()
        levels[runs], new = level, runs[1:] > seen
        jumps[runs[1:][new]] = (np.abs(np.diff(level)) / np.hypot(width[1:], width[:-1]))[new]
        end, noise = _alarm(level, width, _noises(jumps, odds)[runs], odds * 8 / 3)
        if not end:
            break
        rise = level[end] - level[0]
        goes_on = any(last.after == runs[0] and last.change * rise > 0 for last in steps[-1:])
        place, drifts = _change(level[: end + 1], noise, -2 if goes_on else 2)
        seen, start = int(runs[end]), end if drifts else place
        change = float(np.median(level[start : end + 1]) - np.median(level[:place]))
        rest = level[end + 1 : end + 2] - level[end]
        back = place == end and bool((np.abs(rest + change) < np.abs(rest)).any())
        if goes_on and not back and (place == 1 or (drifts and 2 * place <= end)):
            steps[-1] = steps[-1]._replace(kind="drift", after=int(runs[start]))
        else:
            kind = "outlier" if back else "drift" if drifts else "step"
            steps.append(ChangePoint._make([kind, *runs[[0, place, start, end]].tolist(), change]))
        begin, stop = (0, end) if back else (start, end + 1)
        left = left[(left >= runs[begin]) & ~(back & (left == seen))]
        anchor, seen = float(level[begin:stop].mean()), int(runs[stop - 1])
    for at, step in enumerate(steps):
        later = [other.run for other in steps[at + 1 :] if other.kind != "outlier"]
        stop = step.run + 1 if step.kind == "outlier" else [*later, len(levels)][0]
        old, after = levels[step.before : step.run], stop - 1 if step.kind == "step" else step.after
        change = float(np.nanmedian(levels[step.after : stop]) - np.nanmedian(old))
        steps[at] = step._replace(after=after, change=change)
    return Trace(levels, float(_noises(jumps, 0)[-1]), tuple(steps))


def _levels(values: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Return each run's level relative to the first, and its noise relative to the usual: ``(T,)``.

    Each drive is compared with its own mean over n earlier runs, of rate minus level. That mean is
    uncertain, so the drive has weight ``n / (n + 10)``. The spread of drives gives the noise.
    """
    there = ~np.isnan(values)
    rates, weight = np.where(there, values, 0.0), there * weights
    levels, noises = np.full(len(values), math.nan), np.zeros(len(values))
    total, count, away = np.zeros((3, len(weights)))
    levels[0] = level = 0.0
    for run in range(len(values)):
        paired, earlier = weight[run] * count / (count + 10), np.maximum(count, 1)
        rest, share = rates[run] - total / earlier, paired.sum()
        if share:
            levels[run] = level = paired @ rest / share
            away += np.abs(rest - level) * (paired > 0)
            noises[run] = math.sqrt(((paired * away / earlier) ** 2).sum()) / share
        total += (rates[run] - level) * there[run]
        count += there[run]
    usual = np.cumsum(noises) / np.maximum(np.cumsum(noises > 0), 1)
    return levels, np.maximum(noises / np.where(usual > 0, usual, 1), 1)


def _noises(jumps: Floats, odds: float) -> Floats:
    """Return each run's noise from the median of earlier jumps; it is wider after few jumps."""
    past, count = jumps[~np.isnan(jumps)], np.append(0, np.cumsum(~np.isnan(jumps)))
    number = np.arange(1, len(past) + 1)
    parts = [(np.sort(past[:n]), np.sort(past[max(n - 20, 0) : n])) for n in number.tolist()]
    medians = [max(part[(len(part) - 1) // 2] for part in pair) / 0.6745 for pair in parts]
    return np.append(math.inf if odds else 0.0, medians * np.exp(odds / number))[count]


def _alarm(level: Floats, width: Floats, noises: Floats, limit: float) -> tuple[int, Floats]:
    """Return the first run at which two levels fit better by the limit, or 0, and its noises."""
    noises = 1.1 ** np.ceil(np.log(np.maximum(noises, 1e-9)) / math.log(1.1))  # fewer fits
    first, spread = len(level), width
    for noise in dict.fromkeys(noises[np.isfinite(noises)].tolist()):
        looks = np.flatnonzero(noises[:first] == noise)
        tried = np.maximum(width * noise, LEAST_NOISE)[: looks.max(initial=0) + 1]
        alarms = looks[_fit(level[: len(tried)], tried)[2][looks] > limit]
        if len(alarms):
            first, spread = int(alarms[0]), tried[: alarms[0] + 1]
    return first % len(level), spread


def _fit(level: Floats, noise: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the loss of runs up to i at run j's level, its least for i, and the gain of a step.

    The loss is -2 log-likelihood. The gain at run i is the gain of a step at the best place.
    """
    losses = 4 * np.log1p(((level[:, None] - level) / noise[:, None]) ** 2 / 3).cumsum(axis=0)
    later = ~np.tri(len(level), dtype=bool)
    least = np.where(later, math.inf, losses).min(axis=1)
    gains = np.maximum.accumulate(losses - least[:, None], axis=0)[:-1] - losses[1:]
    gains[later[1:]] = -math.inf
    return losses, least, np.append(0, least[1:] + gains.max(axis=1))


def _change(level: Floats, noise: Floats, margin: float) -> tuple[int, bool]:
    """Return the place where the level changes, and whether a drift from there fits better.

    A drift is fitted by least squares to 3 or more runs; outlying runs have less weight.
    """
    losses, least, gains = _fit(level, noise)
    place = int((losses[:-1] - least[:-1, None] - losses[-1]).max(axis=1).argmax()) + 1
    off = np.concatenate([part - np.median(part) for part in np.split(level, [place])])
    weight = 1 / (3 * noise**2 + off**2)
    rises = np.maximum(np.arange(len(level)) - np.arange(len(level) - 3)[:, None], 0.0)
    rises -= (rises @ weight)[:, None] / weight.sum()
    slope = (rises * weight) @ level / (rises**2 @ weight)
    off = level - weight @ level / weight.sum() - slope[:, None] * rises
    lost = 4 * np.log1p((off / noise) ** 2 / 3).sum(axis=1)
    drifts = bool(lost.min(initial=math.inf) + margin < least[-1] - gains[-1])
    return (int(lost.argmin()) + 1 if drifts else place), drifts
