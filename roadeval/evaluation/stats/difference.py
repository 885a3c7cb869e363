"""A mean of paired differences with its interval and p-value, within one drive.

Both masks are of the same frames, so their rates are subtracted frame by frame and the differences
averaged. `roadeval.evaluation.stats.autocorrelation` computes how far the mean of a longer drive of
this kind may lie from that; the p-value of no difference comes from the same distribution, so that
an interval excludes 0 exactly where the p-value is below one minus the confidence. Over several
drives `roadeval.evaluation.stats.drives` makes the same `Difference`.

How often an interval that claims 95 % holds the true mean, in percent of made-up drives, and what
it finds: how often it leaves out 0 if the true mean is one and two standard deviations of a frame's
difference. "naive" takes frames for independent; "two" is the wider of two that are easier to
explain (``benchmarks/intervals.py``, which prints all this); "width" is ours, the median, in
standard deviations.

=================  ======  =====  ====  =======  ====  =======  =====
drives             frames  naive   two    finds  ours    finds  width
=================  ======  =====  ====  =======  ====  =======  =====
independent            60     95    98  100/100    99  100/100   0.66
independent            91     94    98  100/100    98  100/100   0.50
independent          3000     96    98  100/100    96  100/100   0.07
AR 0.5                 60     74    97   92/100    97   95/100   1.05
AR 0.5                 91     72    97   97/100    96  100/100   0.79
AR 0.5                600     73    97  100/100    95  100/100   0.28
AR 0.8                 60     48    94    54/86    96    45/84   2.13
AR 0.8                 91     48    95    68/98    95    64/97   1.56
AR 0.8                190     48    96   94/100    95   97/100   0.94
AR 0.9                 60     35    92    30/56    95    25/62   3.37
AR 0.9                 91     33    92    40/71    95    33/70   2.74
AR 0.9                190     31    95    69/98    96    66/97   1.57
AR 0.9                600     38    97   98/100    95  100/100   0.75
AR 0.95                60     20    88    24/43    90    24/58   3.43
AR 0.95                91     21    92    26/45    94    22/55   3.69
AR 0.95               190     24    95    45/77    96    37/76   2.48
AR 0.95               600     21    96   85/100    95   88/100   1.12
AR 0.95              3000     22    96  100/100    95  100/100   0.46
AR 0.8, Laplace        91     48    95    67/98    95    64/97   1.56
AR 0.8, Laplace       600     46    98  100/100    95  100/100   0.49
AR 0.8, t3             91     45    95    73/98    94    69/93   1.49
AR 0.8, t3            600     49    97  100/100    93   99/100   0.48
slow 0.95 + noise      91     34    81    70/99    82    64/97   1.37
slow 0.95 + noise     190     34    86   81/100    89    72/99   1.30
slow 0.95 + noise     600     32    92   98/100    94   99/100   0.73
slow 0.95 + noise    3000     33    95  100/100    94  100/100   0.32
slow 0.98 + noise     190     21    75    72/98    81    64/95   1.55
slow 0.98 + noise     600     23    88   83/100    90    75/99   1.19
slow 0.98 + noise    3000     22    93  100/100    94  100/100   0.52
two memories          190     26    80    74/99    74    81/99   0.89
two memories          600     24    87   90/100    85   86/100   0.96
bursts                 91     36    78    73/89    88    85/98   2.23
bursts                190     36    86    91/99    96   99/100   1.72
bursts                600     38    93  100/100    96  100/100   0.70
bursts               3000     39    96  100/100    93  100/100   0.26
bursts, reversed       91     34    77    66/84    88    36/58   2.13
bursts, reversed      190     37    87    77/97    95    38/68   1.69
=================  ======  =====  ====  =======  ====  =======  =====

Drift is not allowed for where noise hides it on a short drive, or where it takes longer than the
drive: there three or four of five intervals hold rather than nineteen of twenty. The model's
settings were chosen with drives of these kinds in sight, so others may hold a little less often.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.autocorrelation import Series, mean_distribution
from roadeval.evaluation.stats.corrections import holm_p_values


@dataclass(frozen=True, slots=True)
class Difference:
    """A mean of paired differences, new minus base, with its interval. Fractions."""

    mean: float
    """NaN if no unit has a difference."""
    low: float | None
    high: float | None
    """The interval; within a drive not beyond what the base's rate leaves room for. None together
    with `p`."""
    p: float | None
    """Two-sided p-value of no difference."""
    confidence: float
    """Of the interval."""
    unit: Literal["frames", "drives"]
    """What is averaged: the frames of one drive, or the means of drives."""
    units: int
    """How many have a difference."""
    effective: float | None = None
    """Independent frames that would determine the mean as well; None without an interval, and over
    drives."""
    standard_error: float | None = None
    """Of the mean, without its skewness; None where `effective` is."""
    groups: int | None = None
    """Over drives: groups of drives, each of which counts as one."""
    worse: int | None = None
    better: int | None = None
    equal: int | None = None
    """Over drives: how many are worse, better and exactly the same."""
    needed: int | None = None
    """Units, or groups, that an interval needs; None where there is one."""
    p_holm: float | None = None
    """The p-value after Holm's correction; None where none was applied, see `holm`."""
    comparisons: int | None = None
    """How many differences were corrected for."""

    @property
    def is_zero(self) -> bool:
        """Whether it is 0 on every unit."""
        return self.low == self.high == 0

    @property
    def none_because(self) -> str:
        """Why there is no interval, as a clause; empty where there is one.

        >>> Difference(0.1, None, None, None, 0.95, "drives", 1, groups=1, needed=6).none_because
        '1 drive is too few for an interval (6 are needed)'
        """
        if self.low is not None:
            return ""
        if not self.units:
            return f"undefined on every {self.unit[:-1]}"
        count = self.units if self.groups is None else self.groups
        noun = self.unit[:-1] if count == self.units else "group of drives"
        if count != 1:
            noun = noun.replace("group", "groups") if " " in noun else f"{noun}s"
        verb = "is" if count == 1 else "are"
        return f"{count} {noun} {verb} too few for an interval ({self.needed} are needed)"


def within_drive(rates: Series, base: Series, settings: EvaluationSettings) -> Difference:
    """Average paired differences of a drive's frames, ``rates - base``, with an interval.

    Parameters
    ----------
    rates, base
        ``(n,)`` float64, one a frame in the drive's order; NaN where a rate is undefined, which
        leaves the frame out.
    settings
        The confidence, and the least number of frames.
    """
    differences = rates - base
    known = ~np.isnan(differences)
    series, n = differences[known], int(known.sum())
    mean, confidence = float(series.mean()) if n else math.nan, settings.confidence
    if n < settings.least_frames:
        needed = settings.least_frames
        return Difference(mean, None, None, None, confidence, "frames", n, needed=needed)
    if np.ptp(series) == 0:
        same = float(mean == 0)
        return Difference(mean, mean, mean, same, confidence, "frames", n, float(n), 0.0)
    found = mean_distribution(series)
    low, high = found.interval(confidence)
    level = float(base[known].mean())
    low, high = max(low, -level), min(high, 1 - level)
    return Difference(
        *(mean, low, high, found.p_value(), confidence, "frames", n, found.frames, found.scale)
    )


def holm(family: Sequence[Difference]) -> list[Difference]:
    """Return differences with their p-values corrected for how many they are.

    One without a p-value is not counted, nor is one that is 0 on every unit: nothing can be found
    there.
    """
    values = [None if each.is_zero else each.p for each in family]
    comparisons = sum(p is not None for p in values)
    return [
        each if p is None else replace(each, p_holm=p, comparisons=comparisons)
        for each, p in zip(family, holm_p_values(values), strict=True)
    ]
