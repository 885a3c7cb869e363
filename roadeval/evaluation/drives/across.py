"""The mean of a fleet's differences, and how sure it is.

The unit is the cluster: a group's drives are averaged first, and every group counts alike. Below 30
clusters p-value and interval are those of the exact sign-flip test, from there on Student's.

How often each 95 % interval holds, in percent of 1000 made-up fleets
(``benchmarks/fleet_intervals.py``, which prints this). Drives' effects have a standard deviation of
1, and errors of their own, in that unit, one for all or from 0.1 to 3. "n" is the number of
clusters. In groups, two drives share half of the variance, and errors are 0.1 to 1. "t" is
Student's interval; "at .5" and "at 1" are how often ours finds a true mean of that size; "width" is
its median.

======  ================  === === ==== ===== ==== =====
effect  drives              n   t ours at .5 at 1 width
======  ================  === === ==== ===== ==== =====
normal  errors 0.3          6  96   97    11   35  2.57
normal  errors 0.3         10  95   96    28   77  1.47
normal  errors 0.3         30  96   96    71  100  0.78
normal  errors 0.3        200  95   95   100  100  0.29
normal  errors 0.1 to 3     6  96   97     9   23  3.48
normal  errors 0.1 to 3    10  96   96    17   52  1.96
normal  errors 0.1 to 3    30  95   95    44   93  1.10
normal  errors 0.1 to 3   200  96   96   100  100  0.42
normal  groups of 1 to 7    6  96   97    14   45  2.13
normal  groups of 1 to 7   10  95   95    36   91  1.18
normal  groups of 1 to 7   30  95   95    86  100  0.65
normal  groups of 1 to 7  200  94   94   100  100  0.24
t3      errors 0.3          6  96   97    18   53  2.12
t3      errors 0.3         10  96   96    43   86  1.19
t3      errors 0.3         30  95   95    79   98  0.69
t3      errors 0.3        200  96   96   100  100  0.27
t3      errors 0.1 to 3     6  97   97    12   33  3.33
t3      errors 0.1 to 3    10  96   94    22   59  1.86
t3      errors 0.1 to 3    30  97   97    49   94  1.06
t3      errors 0.1 to 3   200  95   95    99  100  0.41
t3      groups of 1 to 7    6  97   98    20   58  1.88
t3      groups of 1 to 7   10  96   95    48   91  1.05
t3      groups of 1 to 7   30  95   95    89   99  0.58
t3      groups of 1 to 7  200  96   96   100  100  0.23
skewed  errors 0.3          6  91   95     7   52  2.20
skewed  errors 0.3         10  92   92    23   97  1.28
skewed  errors 0.3         30  93   93    78  100  0.74
skewed  errors 0.3        200  95   95   100  100  0.29
skewed  errors 0.1 to 3     6  95   95     6   31  3.44
skewed  errors 0.1 to 3    10  95   94    15   57  1.92
skewed  errors 0.1 to 3    30  95   95    43   93  1.09
skewed  errors 0.1 to 3   200  96   96   100  100  0.42
skewed  groups of 1 to 7    6  94   96    11   65  1.91
skewed  groups of 1 to 7   10  93   93    37   97  1.11
skewed  groups of 1 to 7   30  94   94    90  100  0.62
skewed  groups of 1 to 7  200  96   96   100  100  0.24
======  ================  === === ==== ===== ==== =====

From ten clusters on, the sign-flip test and Student's hold equally often. With six, sign flip's
interval reaches from the least to the greatest mean, which is wider, finds less, and holds more
often where drives are skewed. It is used because it needs no normal distribution, nor drives that
vary alike. Effects more skewed than these are held less often.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from roadeval.evaluation.drives.effect import Clusters, DriveEffect, Values
from roadeval.evaluation.drives.settings import AcrossSettings
from roadeval.evaluation.drives.sign_flip import (
    sign_flip_can_tell,
    sign_flip_interval,
    sign_flip_p,
)
from roadeval.runtime.extensions import special


class Method(StrEnum):
    """Where the mean's p-value and interval come from."""

    T = "t"
    SIGN_FLIP = "sign flip"


class NoInterval(StrEnum):
    """Why there is no interval."""

    NO_DRIVES = "no drives"
    TOO_FEW_CLUSTERS = "too few clusters"


@dataclass(frozen=True, slots=True)
class AcrossDrives:
    """A fleet's differences, summed up. Fractions.

    Parameters
    ----------
    mean
        Of the clusters' means; NaN without a drive.
    low, high, p
        Its interval and the two-sided p-value of no difference, which belong together: the interval
        leaves out 0 exactly where p is below ``1 - confidence``. None together.
    method
        Of both; None where there are none.
    none_because
        Why there are none; None where there are.
    confidence
        Of every interval.
    drives, clusters
        With a difference.
    clusters_needed
        That an interval of this confidence needs.
    worse, better, equal
        Drives whose own mean is worse, better, and exactly the same.
    pooled
        The difference of the rates of all pixels together, in which long drives count for more.
        None where a drive's counts are unknown, for the rest would be another fleet.
    """

    mean: float
    low: float | None
    high: float | None
    p: float | None
    method: Method | None
    none_because: NoInterval | None
    confidence: float
    drives: int
    clusters: int
    clusters_needed: int
    worse: int
    better: int
    equal: int
    pooled: float | None


def across_drives(
    effects: Sequence[DriveEffect],
    settings: AcrossSettings,
    *,
    higher_is_better: bool = False,
) -> AcrossDrives:
    """Sum up the differences of drives, in whatever order they come.

    Parameters
    ----------
    effects
        One a drive. Those without a mean are left out.
    settings
        The confidence, and what an interval needs.
    higher_is_better
        Of the rate: whether a drive with a positive difference is better.

    Examples
    --------
    >>> drives = [DriveEffect(name, name, mean, 100)
    ...           for name, mean in zip("abcdef", [0.01, 0.02, 0.02, 0.03, 0.05, -0.01])]
    >>> found = across_drives(drives, AcrossSettings())
    >>> round(found.mean, 3), found.low, found.high, found.p, found.method.value, found.worse
    (0.02, -0.01, 0.05, 0.09375, 'sign flip', 5)
    """
    clusters = Clusters.of(effects)
    rises, falls = (int(np.sum(sign * clusters.means > 0)) for sign in (1, -1))
    needed = _needed(settings)
    mean, low, high, p, method = _mean(clusters, settings, needed)
    reason = NoInterval.TOO_FEW_CLUSTERS if len(clusters) else NoInterval.NO_DRIVES
    return AcrossDrives(
        *(mean, low, high, p, method),
        none_because=reason if method is None else None,
        confidence=settings.confidence,
        drives=len(clusters.effects),
        clusters=len(clusters),
        clusters_needed=needed,
        worse=falls if higher_is_better else rises,
        better=rises if higher_is_better else falls,
        equal=len(clusters.effects) - rises - falls,
        pooled=_pooled(clusters.effects),
    )


def _needed(settings: AcrossSettings) -> int:
    """Return how many clusters an interval needs: below that, no sign flip is rare enough."""
    needed = settings.least_clusters
    while needed < settings.exact_below and not sign_flip_can_tell(needed, settings.confidence):
        needed += 1
    return needed


def _mean(
    clusters: Clusters, settings: AcrossSettings, needed: int
) -> tuple[float, float | None, float | None, float | None, Method | None]:
    """Return the mean, its interval and p-value, and their method."""
    if not len(clusters):
        return math.nan, None, None, None, None
    means = clusters.group_means()
    mean = float(means.mean())
    if len(means) < needed:
        return mean, None, None, None, None
    if len(means) < settings.exact_below:
        low, high = sign_flip_interval(means, settings.confidence)
        return mean, low, high, sign_flip_p(means), Method.SIGN_FLIP
    return mean, *_student(means, settings.confidence), Method.T


def _student(means: Values, confidence: float) -> tuple[float, float, float]:
    """Return Student's interval of a mean, and the p-value of 0."""
    mean, degrees = float(means.mean()), len(means) - 1
    if np.ptp(means) == 0:
        return mean, mean, float(mean == 0)
    error = float(means.std(ddof=1)) / math.sqrt(len(means))
    half = float(special("stdtrit")(degrees, (1 + confidence) / 2)) * error
    return mean - half, mean + half, float(2 * special("stdtr")(degrees, -abs(mean) / error))


def _pooled(effects: Sequence[DriveEffect]) -> float | None:
    """Return the difference of the rates of all pixels together; None where it is unknown."""
    counts = [
        (*each.base_counts, *each.new_counts)
        for each in effects
        if each.base_counts is not None and each.new_counts is not None
    ]
    if not counts or len(counts) < len(effects):
        return None
    base_wrong, base, wrong, new = (sum(column) for column in zip(*counts, strict=True))
    return wrong / new - base_wrong / base if new and base else None
