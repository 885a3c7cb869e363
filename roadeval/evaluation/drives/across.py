"""The mean of a fleet's differences, how sure it is, and how far drives lie from each other.

The unit is the cluster: a group's drives are averaged first, and every group counts alike. Below 30
clusters p-value and interval are those of the exact sign-flip test, from there on Student's.

How often each 95 % interval holds, in percent of 1000 made-up fleets
(``benchmarks/fleet_intervals.py``, which prints this). Drives' effects have a standard deviation of
1, and errors of their own, in that unit, one for all or from 0.1 to 3; a drive has as many pixels
as make its error. "n" is the number of clusters. In groups, two drives share half of the variance,
and errors are 0.1 to 1. "t" is Student's interval; "at .5" and "at 1" are how often ours finds a
true mean of that size; "width" is its median. "plain" is the percentile bootstrap, and the
Q-profile that takes all drives for independent and normal; "found" is the average estimate of tau,
whose truth is 1; "new" is the share of new drives that lie between the ends given for them.

======  ================  === === ==== ===== ==== ===== ===== === ==== ===== ==== ===== ====
                              mean                      pooled         tau              new
----------------------------- ------------------------- -------------- ---------------- ----
effect  drives              n   t ours at .5 at 1 width plain BCa ours plain ours found ours
======  ================  === === ==== ===== ==== ===== ===== === ==== ===== ==== ===== ====
normal  errors 0.3          6  94   96     9   31  2.58    85  84   92    96   96  0.93   97
normal  errors 0.3         10  95   95    28   76  1.44    88  88   94    95   96  0.97   97
normal  errors 0.3         30  94   94    72  100  0.76    94  94   95    95   96  0.98   96
normal  errors 0.3        200  96   96   100  100  0.29    96  96   96    95   96  1.00   95
normal  errors 0.1 to 3     6  96   97     7   21  3.48    82  79   92    95   97  0.92   97
normal  errors 0.1 to 3    10  95   95    18   50  2.00    86  82   91    95   96  0.96   97
normal  errors 0.1 to 3    30  96   96    44   93  1.09    90  87   92    94   96  0.99   96
normal  errors 0.1 to 3   200  94   94   100  100  0.42    93  92   93    96   96  1.00   95
normal  groups of 1 to 7    6  96   98    15   48  2.12    84  82   92    90  100  0.93  100
normal  groups of 1 to 7   10  95   95    38   89  1.20    88  87   94    89  100  0.97   99
normal  groups of 1 to 7   30  96   96    86  100  0.65    93  93   94    86  100  0.99   97
normal  groups of 1 to 7  200  95   95   100  100  0.24    95  95   95    87   99  1.00   95
t3      errors 0.3          6  96   97    16   51  2.09    87  86   94    86   90  0.81   96
t3      errors 0.3         10  96   95    43   86  1.18    90  88   94    80   85  0.86   95
t3      errors 0.3         30  96   96    80   99  0.68    93  90   95    67   80  0.94   95
t3      errors 0.3        200  95   95   100  100  0.27    94  93   94    48   78  0.98   95
t3      errors 0.1 to 3     6  97   97    12   29  3.28    82  80   93    90   94  0.81   96
t3      errors 0.1 to 3    10  97   95    21   54  1.87    86  82   92    89   92  0.87   96
t3      errors 0.1 to 3    30  96   96    46   92  1.05    89  84   90    79   87  0.91   95
t3      errors 0.1 to 3   200  96   96    99  100  0.42    94  90   94    65   83  0.98   95
t3      groups of 1 to 7    6  96   97    21   58  1.82    82  81   92    65   98  0.82   98
t3      groups of 1 to 7   10  96   96    46   90  1.06    88  86   93    62   98  0.88   97
t3      groups of 1 to 7   30  96   96    86   99  0.59    91  88   92    52   94  0.94   96
t3      groups of 1 to 7  200  95   95   100  100  0.23    94  93   94    40   89  0.96   95
skewed  errors 0.3          6  92   95     7   55  2.27    82  82   90    84   90  0.87   95
skewed  errors 0.3         10  92   92    23   97  1.30    88  88   92    82   88  0.92   95
skewed  errors 0.3         30  94   94    78  100  0.73    93  94   94    76   88  0.96   95
skewed  errors 0.3        200  94   94   100  100  0.29    94  94   94    71   91  1.00   95
skewed  errors 0.1 to 3     6  94   95     6   31  3.29    77  75   86    90   94  0.82   96
skewed  errors 0.1 to 3    10  96   95    15   56  1.94    83  80   90    88   92  0.93   96
skewed  errors 0.1 to 3    30  95   95    42   94  1.10    86  86   89    82   88  0.96   95
skewed  errors 0.1 to 3   200  94   94   100  100  0.42    93  93   93    79   92  0.99   95
skewed  groups of 1 to 7    6  95   97    10   66  1.95    83  82   91    78   98  0.88   98
skewed  groups of 1 to 7   10  93   93    37   98  1.12    86  85   92    70   98  0.91   97
skewed  groups of 1 to 7   30  93   93    91  100  0.62    90  91   92    66   98  0.97   96
skewed  groups of 1 to 7  200  94   94   100  100  0.24    93  94   94    60   98  0.99   95
======  ================  === === ==== ===== ==== ===== ===== === ==== ===== ==== ===== ====

From ten clusters on, the sign-flip test and Student's hold equally often. With six, sign flip's
interval reaches from the least to the greatest mean, which is wider, finds less, and holds more
often where drives are skewed. It is used because it needs no normal distribution, nor drives that
vary alike.

What does not hold: the pooled rate's interval, in nine of ten fleets rather than nineteen of twenty
where six or ten clusters decide, or a few that have most of the pixels; and that of tau, in eight
or nine of ten where drives are heavy-tailed or skewed, however many there are. With few groups
tau's interval and a new drive's are too wide. Effects more skewed than these are held less often.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from roadeval.evaluation.drives.bootstrap import pooled_counts, pooled_difference, pooled_interval
from roadeval.evaluation.drives.effect import Clusters, DriveEffect, Values
from roadeval.evaluation.drives.settings import AcrossSettings
from roadeval.evaluation.drives.sign_flip import (
    sign_flip_can_tell,
    sign_flip_interval,
    sign_flip_p,
)
from roadeval.evaluation.drives.spread import Spread, spread_of
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
    pooled, pooled_low, pooled_high
        The difference of the rates of all pixels together, in which long drives count for more, and
        its interval. None where a drive's counts are unknown; the interval also where the mean has
        none.
    spread
        Between drives; None where too few clusters have standard errors.
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
    pooled_low: float | None
    pooled_high: float | None
    spread: Spread | None


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
    >>> drives = [DriveEffect(name, name, mean, None, 100)
    ...           for name, mean in zip("abcdef", [0.01, 0.02, 0.02, 0.03, 0.05, -0.01])]
    >>> found = across_drives(drives, AcrossSettings())
    >>> round(found.mean, 3), found.low, found.high, found.p, found.method.value, found.worse
    (0.02, -0.01, 0.05, 0.09375, 'sign flip', 5)
    """
    clusters = Clusters.of(effects)
    rises, falls = (int(np.sum(sign * clusters.means > 0)) for sign in (1, -1))
    needed = _needed(settings)
    pooled, pooled_low, pooled_high = _pooled(clusters, settings, needed)
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
        pooled=pooled,
        pooled_low=pooled_low,
        pooled_high=pooled_high,
        spread=spread_of(clusters, settings),
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


def _pooled(
    clusters: Clusters, settings: AcrossSettings, needed: int
) -> tuple[float | None, float | None, float | None]:
    """Return the difference of pooled rates with its interval."""
    counts = pooled_counts(clusters)
    if counts is None:
        return None, None, None
    difference = float(pooled_difference(counts.sum(axis=0)))
    if math.isnan(difference) or len(clusters) < needed:
        return (None if math.isnan(difference) else difference), None, None
    return difference, *pooled_interval(counts, settings)
