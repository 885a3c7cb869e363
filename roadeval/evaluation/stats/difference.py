"""Mean differences of a rate between two masks, within a drive and over drives.

The masks are of the same frames, so their rates are subtracted frame by frame. Neighbouring frames
of a drive resemble each other: `mean_distribution` tells how far off their mean may be. Drives are
independent: interval and p-value come from the exact sign-flip test below 30 groups of drives, and
from Student's from 30 on. An interval excludes 0 exactly if p is below one minus the confidence.

The sign-flip test needs no normal distribution, and no equal variance of drives. From ten groups on
its interval holds as often as Student's. With six it reaches from the least to the greatest mean:
it is wider, detects less, and holds more often if drives are skewed.

References
----------
.. [1] J. A. Hartigan, Journal of the American Statistical Association 64, 1969, 1303-1317.
.. [2] E. Horowitz, S. Sahni, Journal of the ACM 21, 1974, 277-292.
.. [3] S. Holm, Scandinavian Journal of Statistics 6, 1979, 65-70.
.. [4] Y. Benjamini, Y. Hochberg, Journal of the Royal Statistical Society B 57, 1995, 289-300.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Final, Literal

import numpy as np
from pydantic import BeforeValidator

from roadeval.data.arrays import Floats, Sums
from roadeval.data.words import counted
from roadeval.evaluation.metrics import METRICS, TESTED
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.autocorrelation import mean_distribution

if TYPE_CHECKING:
    import pandas as pd

LEAST_GROUPS: Final = 6
"""Number of groups of drives that an interval needs."""
STUDENT_FROM: Final = 30
"""Number of groups from which the interval is Student's, which assumes a normal mean."""


@dataclass(frozen=True)
class Difference:
    """A mean of paired differences, new minus base, with its interval. Fractions."""

    mean: Annotated[float, BeforeValidator(lambda read: math.nan if read is None else read)]
    """NaN if no unit has a difference; null in JSON."""
    low: float | None
    high: float | None
    """The interval; within a drive it stays in the range that the base's rate allows. None together
    with `p`."""
    p: float | None
    """Two-sided p-value of no difference."""
    confidence: float
    unit: Literal["frames", "drives"]
    """Whether the mean is over the frames of one drive, or over the means of drives."""
    units: int
    """Number of frames or drives that have a difference."""
    effective: float | None = None
    """Number of independent frames that would determine the mean equally well; None without an
    interval, and over drives."""
    standard_error: float | None = None
    """The mean's standard error; None if `effective` is."""
    degrees: float | None = None
    """Degrees of freedom. Apart from skewness and the limits of the base's rate, the interval is
    ``mean ± t(degrees) standard_error``, and the p-value belongs to ``mean / standard_error``."""
    groups: int | None = None
    """Number of groups of drives, which have equal weights; None within a drive."""
    worse: int | None = None
    better: int | None = None
    equal: int | None = None
    """Number of units that are worse than the base, better, and exactly the same."""
    needed: int | None = None
    """Number of units, or groups, that an interval needs; None if there is an interval."""
    p_holm: float | None = None
    """The p-value after Holm's correction; None if none was applied, see `holm`."""
    comparisons: int | None = None
    """Number of differences that were corrected for."""

    @property
    def is_zero(self) -> bool:
        """Whether it is 0 on every unit."""
        return self.low == self.high == 0 or 0 < self.units == self.equal

    @property
    def none_because(self) -> str:
        """The reason why there is no interval, as a clause; empty if there is one.

        >>> Difference(0.1, None, None, None, 0.95, "drives", 1, groups=1, needed=6).none_because
        '1 drive is too few for an interval (6 are needed)'
        """
        if self.low is not None:
            return ""
        if not self.units:
            return f"undefined on every {self.unit[:-1]}"
        count = self.units if self.groups is None else self.groups
        what = counted(count, self.unit[:-1] if count == self.units else "group")
        verb = "is" if count == 1 else "are"
        return f"{what} {verb} too few for an interval ({self.needed} are needed)"


def interval(
    differences: Floats,
    confidence: float = 0.95,
    unit: Literal["frames", "drives"] = "frames",
    *,
    averaged: Floats | None = None,
    least: int = 10,
    higher_is_better: bool = False,
) -> Difference:
    """Average ``(n,)`` paired differences, with an interval and the two-sided p-value of 0.

    Differences are of a drive's frames in their order, or of drives; NaN is left out. ``averaged``
    has the values to average instead: of moments that several cameras saw, or of groups of drives.
    An interval needs ``least`` frames, or `LEAST_GROUPS` groups, or more for a high ``confidence``.
    """
    defined = differences[~np.isnan(differences)]
    values = defined if averaged is None else averaged
    count = len(values)
    if unit == "drives":
        # The least p-value of a sign-flip test is 2^(1 - n): 1/16 for five groups is above 5 %.
        least = min(max(LEAST_GROUPS, math.floor(2 - math.log2(1 - confidence))), STUDENT_FROM)
    low = high = p = effective = error = degrees = None
    if count >= least and unit == "drives" and count < STUDENT_FROM:
        low, high = sign_flip_interval(values, confidence)
        p = sign_flip_p(values)
    elif count >= least:
        mean = mean_distribution(values, independent=unit == "drives")
        low, high = mean.interval(confidence)
        p = mean.p_value()
        if unit == "frames":
            effective, error, degrees = mean.effective, mean.standard_error, mean.degrees
    rises, falls = int((defined > 0).sum()), int((defined < 0).sum())
    return Difference(
        mean=float(values.mean()) if count else math.nan,
        low=low,
        high=high,
        p=p,
        confidence=confidence,
        unit=unit,
        units=len(defined),
        effective=effective,
        standard_error=error,
        degrees=degrees,
        groups=count if unit == "drives" else None,
        worse=falls if higher_is_better else rises,
        better=rises if higher_is_better else falls,
        equal=len(defined) - rises - falls,
        needed=least if low is None else None,
    )


def p_value(values: Floats, unit: Literal["frames", "drives"]) -> float:
    """Return the two-sided p-value of the hypothesis that the mean is 0, as in `interval`."""
    if unit == "drives" and len(values) < STUDENT_FROM:
        return sign_flip_p(values)
    return mean_distribution(values, independent=unit == "drives").p_value()


def within_drive(pairs: pd.DataFrame, rate: str, settings: EvaluationSettings) -> Difference:
    """Average the differences of a rate over a drive's frames, with an interval.

    ``pairs`` are rows from `roadeval.evaluation.tables.pair_rows`, with columns ``camera``,
    ``stamp_ns``, the rate, and the base's rate, which ends in ``_base``. Frames without a
    difference are left out. The mean over several cameras is the mean of their means. Frames of the
    same time are not further evidence: a copy of a camera changes nothing, see `at_moments`.
    """
    stamps, base = pairs["stamp_ns"].to_numpy(), pairs[f"{rate}_base"].to_numpy()
    differences, camera = pairs[rate].to_numpy() - base, pairs["camera"].factorize()[0]
    defined = ~np.isnan(differences)
    cameras = [defined & (camera == number) for number in np.unique(camera[defined])]
    series = [(stamps[frames], differences[frames]) for frames in cameras]
    difference = interval(
        differences,
        settings.confidence,
        averaged=at_moments(series) if len(series) > 1 else None,
        least=settings.least_frames,
        higher_is_better=METRICS[rate].higher_is_better,
    )
    if difference.low is None or difference.high is None or not difference.standard_error:
        return difference
    level = float(np.mean([base[frames].mean() for frames in cameras]))
    low, high = max(difference.low, -level), min(difference.high, 1 - level)
    return replace(difference, low=low, high=high)


def at_moments(cameras: Sequence[tuple[Sums, Floats]]) -> Floats:
    """Return a value for each moment, ``(T,)``; their mean is the mean of the cameras' means.

    ``cameras`` have stamps and differences, ``(n,)`` each. Values are scaled to vary as their mean
    does: at moment t of T the value is ``mean + T sum_i (d_i - mean_c) / (C n_c)`` over the frames
    i of that moment, where camera c of C took frame i and has n_c frames. The camera with
    most frames sets the moments; a frame of another camera belongs to the nearest moment.
    """
    clock = max((stamps for stamps, _ in cameras), key=len)
    order, start = np.argsort(clock, kind="stable"), clock.min()
    moments = clock[order] - start
    total, sums = 0.0, np.zeros(len(clock))
    for stamps, differences in cameras:
        mean = differences.mean()
        total += mean / len(cameras)
        parts = (differences - mean) * (len(clock) / (len(cameras) * len(differences)))
        nearest = np.searchsorted(moments[1:] + moments[:-1], 2 * (stamps - start))
        np.add.at(sums, order[nearest], parts)
    return total + sums


def group_means(drives: pd.DataFrame) -> Floats:
    """Return the mean of each group's drives, ``(g,)``, whatever the order of the drives."""
    ordered = drives[drives["mean"].notna()].sort_values(["group", "drive"])
    return ordered.groupby("group")["mean"].mean().to_numpy(float)


def over_drives(drives: pd.DataFrame, confidence: float, rate: str = TESTED) -> Difference:
    """Average the differences of a rate over drives, in any order, with an interval.

    Columns are ``drive``; ``group``, a name shared with other drives (a day or a route), or unique
    to the drive; and ``mean``, the mean difference on the drive, NaN if no frame has one. A group's
    drives are averaged first, and all groups have equal weights.

    Examples
    --------
    >>> import pandas as pd
    >>> means = [0.01, 0.02, 0.02, 0.03, 0.05, -0.01]
    >>> drives = pd.DataFrame({"drive": [*"abcdef"], "group": [*"abcdef"], "mean": means})
    >>> difference = over_drives(drives, 0.95)
    >>> round(difference.mean, 3), difference.low, difference.high, difference.p, difference.worse
    (0.02, -0.01, 0.05, 0.09375, 5)
    """
    return interval(
        drives["mean"].to_numpy(float),
        confidence,
        "drives",
        averaged=group_means(drives),
        higher_is_better=METRICS[rate].higher_is_better,
    )


def strata(
    drives: pd.DataFrame, tags: Sequence[str], confidence: float
) -> Iterator[tuple[str, str, Difference]]:
    """Yield each tag, each of its values, and the difference on the drives that have the value.

    ``drives`` are as in `over_drives`, with a column for each tag. A drive without a value is left
    out for that tag, and a tag with one value for all drives is left out. p-values are corrected
    for the number of differences.
    """
    drives = drives[drives["mean"].notna()]
    parts = {
        (tag, str(value)): rows
        for tag in tags
        if len(drives[tag].unique()) > 1
        for value, rows in drives.groupby(tag)
    }
    family = holm([over_drives(part, confidence) for part in parts.values()])
    yield from ((*part, difference) for part, difference in zip(parts, family, strict=True))


def sign_flip_p(values: Floats, mean: float = 0.0) -> float:
    """Compute the exact two-sided p-value of the hypothesis that the mean is ``mean``.

    ``p = #{s : |sum s_i (x_i - mean)| >= |sum (x_i - mean)|} / 2^n``: if the mean is right and each
    of the ``(n,)`` values is symmetric about it, all patterns of signs s are equally likely. If the
    signs of a set of values are flipped, the sum does not fall exactly if the set's sum is at most
    0. Such sets are counted, as pairs from both halves [2]_: two more values double the time.
    `scipy.stats.permutation_test`, which tries the patterns, takes seconds and 1 GB for 20 values.
    """
    away = values - mean
    if away.sum() < 0:
        away = -away
    middle, rounding = len(away) // 2, 1e-12 * float(np.abs(away).sum())
    halves = []
    for half in (away[:middle], away[middle:]):
        sums = np.zeros(1)
        for value in half:
            sums = np.concatenate([sums, sums + value])
        halves.append(np.sort(sums))
    sets = int(np.searchsorted(halves[1], rounding - halves[0], side="right").sum())
    return min(float(np.ldexp(sets, 1 - len(away))), 1.0)


def sign_flip_interval(values: Floats, confidence: float) -> tuple[float, float]:
    """Compute the least and greatest mean with a p-value of at least ``1 - confidence`` [1]_."""
    return _lower_end(values, confidence), -_lower_end(-values, confidence)


def _lower_end(values: Floats, confidence: float) -> float:
    """Return the least mean that is not rejected, by bisection to 1e-8 of the range, from above.

    0 is tried first, so that rounding puts no end on the wrong side of 0.
    """
    low, high = float(values.min()), float(values.mean())
    if sign_flip_p(values, low) >= 1 - confidence:
        return low
    middle, precision = 0.0 if low < 0 < high else (low + high) / 2, 1e-8 * (high - low)
    while high - low > precision:
        rejected = sign_flip_p(values, middle) < 1 - confidence
        low, high = (middle, high) if rejected else (low, middle)
        middle = (low + high) / 2
    return high


def holm(family: Sequence[Difference]) -> list[Difference]:
    """Return differences with p-values corrected so that a false finding among them is rare.

    If no difference of the family is real, the probability that any corrected p-value is below
    ``a`` is at most ``a``, however the comparisons depend on each other [3]_. A difference without
    a p-value is not counted, nor is one that is 0 on every unit.
    """
    tested = sorted(
        (difference.p, place)
        for place, difference in enumerate(family)
        if difference.p is not None and not difference.is_zero
    )
    corrected, least = list(family), 0.0
    for rank, (p, place) in enumerate(tested):
        least = max(least, min((len(tested) - rank) * p, 1.0))
        corrected[place] = replace(family[place], p_holm=least, comparisons=len(tested))
    return corrected


def benjamini_hochberg(values: Sequence[float | None]) -> list[float | None]:
    """Correct p-values so that few findings are false.

    A share of at most ``q`` of the findings with a corrected value of at most ``q`` is false on
    average: ``min over j >= i of p_(j) m / j``, for the i-th smallest of m [4]_. That holds if the
    tests are independent, as tests of different drives are, or depend on each other positively.
    None stands for a finding that was not tested: it is not counted and stays None.
    """
    tested = sorted((p, place) for place, p in enumerate(values) if p is not None)
    corrected, least = list(values), 1.0
    for rank in range(len(tested), 0, -1):
        p, place = tested[rank - 1]
        least = min(least, p * len(tested) / rank)
        corrected[place] = least
    return corrected
