"""Mean differences between masks, the intervals around them, and what is left of many findings.

Both masks are of the same frames, so their rates are subtracted frame by frame and the differences
averaged. How far the mean of a longer drive of this kind may lie from that is computed by
`roadeval.evaluation.autocorrelation`; the p-value of no difference comes from the same
distribution, so that an interval leaves out 0 exactly where the p-value is below one minus the
confidence.

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

What cannot be seen is not allowed for: a drift that noise hides on a short drive, or one that takes
longer than the drive. There three or four of five intervals hold rather than nineteen of twenty.
The model's settings were chosen with drives of these kinds in sight, so that others may hold a
little less often.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from roadeval.evaluation.autocorrelation import Series, mean_distribution
from roadeval.evaluation.corrections import holm_p_values
from roadeval.evaluation.settings import EvaluationSettings


@dataclass(frozen=True, slots=True)
class Difference:
    """A mean of paired differences over a drive's frames, with its interval. Fractions.

    Parameters
    ----------
    mean
        NaN if no frame has a difference.
    low, high
        The interval around it, within what the difference can be if the base's rate is as it was
        measured. None below `EvaluationSettings.least_frames`.
    confidence
        What the interval claims.
    p
        Two-sided p-value of no difference; None without an interval.
    p_holm
        The same after Holm's correction, see `holm`; None where none was applied.
    comparisons
        How many were corrected for; None where none was applied.
    standard_error
        Of the mean, without its skewness; None without an interval.
    frames
        Frames with a difference.
    effective_frames
        Independent frames that would determine the mean as well; None without an interval.
    """

    mean: float
    low: float | None
    high: float | None
    confidence: float
    p: float | None
    frames: int
    effective_frames: float | None
    p_holm: float | None = None
    comparisons: int | None = None
    standard_error: float | None = None


def mean_difference(rates: Series, base: Series, settings: EvaluationSettings) -> Difference:
    """Average paired differences, ``rates - base``, with an interval.

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
        return Difference(mean, None, None, confidence, None, n, None)
    if np.ptp(series) == 0:
        same = float(mean == 0)
        return Difference(mean, mean, mean, confidence, same, n, float(n), standard_error=0.0)
    found = mean_distribution(series)
    low, high = found.interval(confidence)
    level = float(base[known].mean())
    low, high = max(low, -level), min(high, 1 - level)
    told = found.p_value(), n, found.frames
    return Difference(mean, low, high, confidence, *told, standard_error=found.scale)


def holm(family: Sequence[Difference]) -> list[Difference]:
    """Correct p-values for the number of comparisons, so that few findings are false.

    By `roadeval.evaluation.corrections.holm_p_values`. One without a p-value is left out; so is one
    whose difference is 0 on every frame, where nothing can be found.
    """
    values = [None if each.low == each.high == 0 else each.p for each in family]
    comparisons = sum(p is not None for p in values)
    return [
        each if p is None else replace(each, p_holm=p, comparisons=comparisons)
        for each, p in zip(family, holm_p_values(values), strict=True)
    ]
