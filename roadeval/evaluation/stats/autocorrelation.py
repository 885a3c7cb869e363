"""The mean of a series whose neighbours resemble each other, and how far off it may lie.

A series is modelled as a slow part, a first-order autoregression, and a part that is new on each
frame. Which coefficient and which share of the slow part is not known, so a grid of both is tried:
each is weighted by how well it explains the series, every coefficient from 0 to 1 being as likely
before. Given both, the error of the mean is Student's; the mean's distribution is the mixture.

What explains a series are its slowest cosine coefficients, as in [1]_: they show how the mean of
such a stretch varies, whatever happens from frame to frame. They do not hold the mean, so it need
not be subtracted, and are all but uncorrelated under every model of the grid.

Skewed series, such as bursts on a few frames, have a skewed mean: a drive that met few bursts has a
mean that is too low *and* a spread that is too small. The mixture is bent by the transformation of
[2]_, section 2, with the series' skewness as far as that exceeds its own error.

The masks of two results are of the same frames, so their rates are subtracted frame by frame: that
is the series. The p-value of no difference comes from the same distribution, so that an interval
excludes 0 exactly where the p-value is below one minus the confidence. Over several drives
`roadeval.evaluation.stats.drives` makes the same `Difference`.

How often the intervals hold, and what they find, is in ``benchmarks/INTERVALS.md``. Drift is not
allowed for where noise hides it on a short drive, or where it takes longer than the drive: there
three or four of five intervals hold rather than nineteen of twenty.

References
----------
.. [1] U. K. Müller, M. W. Watson, Measuring Uncertainty about Long-Run Predictions, Review of
   Economic Studies 83, 2016, 1711-1740.
.. [2] P. Hall, On the Removal of Skewness by Transformation, Journal of the Royal Statistical
   Society B 54, 1992, 221-228.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator

from roadeval.data.arrays import Floats, Sums
from roadeval.data.words import counted
from roadeval.evaluation.settings import EvaluationSettings

_FEWEST: Final = 90
_PER_ROOT: Final = 2.5
"""Cosine coefficients that are looked at: the fewest, and in roots of the series' length."""
_SHARES: Final = {1.0: 0.5, 0.95: 0.06, 0.75: 0.12, 0.5: 0.12, 0.25: 0.2}
"""The slow part's shares of the variance that are tried, and their weights beforehand: all of it
and less of it are as likely, and less is any share as likely as another."""
_STEPS: Final = 48
"""Coefficients of the autoregression that are tried."""
_LONGEST: Final = 10
"""The longest memory that is tried, in lengths of the series."""
_SKEWNESS_ERROR: Final = 6.0
"""Variance of the skewness of n independent normal values, times n."""


class _Models(NamedTuple):
    """What each of the ``g`` models of the grid expects of a series of a given length."""

    precisions: Floats
    """``(g, m)``: one over the variances of the cosine coefficients, in the series' variance."""
    log_factor: Floats
    """``(g,)``: the logarithm of the weight before any series is seen, times the factor of the
    likelihood that depends on the model alone."""
    of_mean: Floats
    """``(g,)``: variance of the mean, in the series' variance."""


class MeanDistribution(NamedTuple):
    """Distribution of the mean of a process, given a series that is a stretch of it."""

    mean: float
    errors: Floats
    weights: Floats
    """``(g,)``: the mean's standard error under each model, and the models' weights; sum 1."""
    degrees: int
    frames: float
    """Independent values that would determine the mean as well."""
    scale: float
    skewness: float
    """Standard error and skewness of the mean, for the transformation."""

    def p_value(self, value: float = 0.0) -> float:
        """Return the two-sided p-value of the hypothesis that the process' mean is ``value``."""
        straight = _straightened((self.mean - value) / self.scale, self.skewness)
        return _beyond(abs(straight) * self.scale, self.errors, self.weights, self.degrees)

    def interval(self, confidence: float) -> tuple[float, float]:
        """Return the ends of the interval: the values whose p-value is ``1 - confidence``."""
        half = self._half_width(confidence) / self.scale
        low, high = (_bent(end, self.skewness) for end in (half, -half))
        return self.mean - self.scale * low, self.mean - self.scale * high

    def _half_width(self, confidence: float) -> float:
        from scipy.special import stdtrit

        quantile = float(stdtrit(self.degrees, (1 + confidence) / 2))
        low, high = quantile * float(self.errors.min()), quantile * float(self.errors.max())
        # By halves: scipy.optimize takes longer to import than a drive's differences to compute.
        while high - low > 1e-12 * high:
            middle = (low + high) / 2
            beyond = _beyond(middle, self.errors, self.weights, self.degrees)
            low, high = (middle, high) if beyond > 1 - confidence else (low, middle)
        return high


def mean_distribution(series: Floats) -> MeanDistribution:
    """Estimate the mean of a stationary series, and its uncertainty.

    The series is ``(n,)`` float64, n at least 4, and not constant.
    """
    models = _models(len(series))
    spreads, weights, degrees = _explained(series, models)
    errors = np.sqrt(models.of_mean) * spreads
    scale = float(weights @ errors**-2) ** -0.5
    frames = min(float(series.var()) / scale**2, len(series))
    centred = series - series.mean()
    skewness = float((centred**3).mean() / (centred**2).mean() ** 1.5)
    noise = _SKEWNESS_ERROR / frames
    return MeanDistribution(
        mean=float(series.mean()),
        errors=errors,
        weights=weights,
        degrees=degrees,
        frames=frames,
        scale=scale,
        skewness=(skewness**3 / (skewness**2 + noise)) / math.sqrt(frames),
    )


def _explained(series: Floats, models: _Models) -> tuple[Floats, Floats, int]:
    """Return each model's estimate of the standard deviation, its weight, and their degrees."""
    n, degrees = len(series), models.precisions.shape[1]
    numbers = np.arange(1, degrees + 1)
    spectrum = np.fft.rfft(np.concatenate([series, series[::-1]]))[numbers]
    squares = (spectrum * np.exp(-0.5j * np.pi * numbers / n)).real ** 2 / (2 * n)
    variances = models.precisions @ squares / degrees
    fit = models.log_factor - degrees / 2 * np.log(variances)
    weights = np.exp(fit - fit.max())
    return np.sqrt(variances), weights / weights.sum(), degrees


@lru_cache(maxsize=8)
def _models(n: int) -> _Models:
    """Return the models for series of length ``n``.

    The coefficients lie the closer together, the nearer to 1, where they matter most; the prior
    weight, in proportion to their distance from 1, makes up for that.
    """
    distance = (_LONGEST * n) ** -np.linspace(0, 1, _STEPS)
    coefficients = np.tile(1 - distance, len(_SHARES))
    shares = np.repeat(list(_SHARES), _STEPS)
    numbers = np.arange(1, min(max(_FEWEST, round(_PER_ROOT * math.sqrt(n))), n - 1) + 1)
    slow = _cosine_variances(coefficients[:, None], numbers, n)
    variances = shares[:, None] * slow + (1 - shares[:, None])
    prior = np.outer(list(_SHARES.values()), distance).ravel()
    return _Models(
        precisions=1 / variances,
        log_factor=np.log(prior) - np.log(variances).sum(axis=1) / 2,
        of_mean=_variance_of_mean(coefficients, shares, n),
    )


def _cosine_variances(coefficient: Floats, numbers: Sums, n: int) -> Floats:
    """Compute variances of the orthonormal cosine coefficients (DCT-II) of an autoregression.

    Exact for a stationary one of variance 1 and length ``n``: its spectrum, less what the two ends
    cut off. ``coefficient`` is ``(g, 1)``, at least 0 and below 1; ``numbers`` are ``(m,)``: which
    coefficients, from 1.
    """
    r, angle = coefficient, np.pi * numbers / n
    gain = 1 - 2 * r * np.cos(angle) + r**2
    parity = np.where(numbers % 2, -1.0, 1.0)
    ends = 4 * r / n * ((1 - r) * np.cos(angle / 2)) ** 2 * (1 - parity * r**n)
    variances: Floats = (1 - r**2) / gain - ends / gain**2
    return variances


def _variance_of_mean(coefficients: Floats, shares: Floats, n: int) -> Floats:
    """Compute the variance of the mean of ``n`` values, in their own variance, for each model."""
    r = coefficients
    slow = (1 + r) / (1 - r) - 2 * r * (1 - r**n) / (n * (1 - r) ** 2)
    variances: Floats = (shares * slow + (1 - shares)) / n
    return variances


def _beyond(distance: float, errors: Floats, weights: Floats, degrees: int) -> float:
    """Return the probability that the mean is further off than ``distance``, skewness aside."""
    from scipy.special import stdtr

    return float(2 * weights @ stdtr(degrees, -distance / errors))


def _straightened(t: float, skewness: float) -> float:
    """Transform a studentized mean of a given skewness so that it is symmetric; [2]."""
    return t + skewness * t**2 / 3 + skewness**2 * t**3 / 27 + skewness / 6


def _bent(t: float, skewness: float) -> float:
    """Return what `_straightened` transforms to ``t``."""
    if abs(skewness) < 1e-6:
        return t
    return 3 / skewness * (math.cbrt(1 + skewness * (t - skewness / 6)) - 1)


@dataclass(frozen=True)
class Difference:
    """A mean of paired differences, new minus base, with its interval. Fractions."""

    mean: Annotated[float, BeforeValidator(lambda read: math.nan if read is None else read)]
    """NaN if no unit has a difference; null where it is read from JSON."""
    low: float | None
    high: float | None
    """The interval; within a drive not beyond what the base's rate leaves room for. None together
    with `p`."""
    p: float | None
    """Two-sided p-value of no difference."""
    confidence: float
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
    """How many units are worse than the base, better, and exactly the same."""
    needed: int | None = None
    """Units, or groups, that an interval needs; None where there is one."""
    p_holm: float | None = None
    """The p-value after Holm's correction; None where none was applied, see `holm`."""
    comparisons: int | None = None
    """How many differences were corrected for."""

    @property
    def is_zero(self) -> bool:
        """Whether it is 0 on every unit."""
        return self.low == self.high == 0 or 0 < self.units == self.equal

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
        what = counted(count, self.unit[:-1] if count == self.units else "group")
        verb = "is" if count == 1 else "are"
        return f"{what} {verb} too few for an interval ({self.needed} are needed)"


class CameraRates(NamedTuple):
    """The rates of two masks on the same frames of a camera, in its order.

    NaN where a rate is undefined, which leaves the frame out.
    """

    stamps: Sums
    """``(n,)`` nanoseconds."""
    rates: Floats
    base: Floats
    """``(n,)`` each."""

    def known(self) -> CameraRates:
        """Return them on the frames that have both."""
        both = ~np.isnan(self.rates - self.base)
        return CameraRates(self.stamps[both], self.rates[both], self.base[both])


def within_drive(
    cameras: Sequence[CameraRates], settings: EvaluationSettings, *, higher_is_better: bool = False
) -> Difference:
    """Average paired differences of a drive's frames, ``rates - base``, with an interval.

    Of several cameras it is the mean of the cameras' means. Frames that they took at the same
    time are no further evidence: a camera that is there twice changes nothing, see `at_moments`.
    """
    kept = [known for each in cameras if len((known := each.known()).stamps)]
    frames = np.concatenate([[], *(each.rates - each.base for each in kept)])
    series = at_moments(kept) if len(kept) > 1 else frames
    n = len(frames)
    mean, confidence = float(series.mean()) if n else math.nan, settings.confidence
    worse, better = int((frames > 0).sum()), int((frames < 0).sum())
    if higher_is_better:
        worse, better = better, worse
    found = Difference(
        *(mean, None, None, None, confidence, "frames", n),
        worse=worse,
        better=better,
        equal=n - worse - better,
    )
    if len(series) < settings.least_frames:
        return replace(found, needed=settings.least_frames)
    if np.ptp(series) == 0:
        same, sure = float(mean == 0), float(len(series))
        return replace(found, low=mean, high=mean, p=same, effective=sure, standard_error=0.0)
    means = mean_distribution(series)
    low, high = means.interval(confidence)
    level = float(np.mean([each.base.mean() for each in kept]))
    return replace(
        found,
        low=max(low, -level),
        high=min(high, 1 - level),
        p=means.p_value(),
        effective=means.frames,
        standard_error=means.scale,
    )


def at_moments(cameras: Sequence[CameraRates]) -> Floats:
    """Return a value a moment, ``(T,)``; their mean is that of the cameras' mean differences.

    It varies as that mean does: at moment t of T it is ``mean + T sum_i (d_i - mean_c) / (C n_c)``
    over the frames i that were taken then, each by a camera c of C, which has n_c frames. The
    moments are the frames of the camera that has most; a frame of another belongs to the nearest.
    """
    clock = max(cameras, key=lambda each: len(each.stamps)).stamps
    total, sums = 0.0, np.zeros(len(clock))
    for each in cameras:
        differences = each.rates - each.base
        own = differences.mean()
        total += own / len(cameras)
        parts = (differences - own) * (len(clock) / (len(cameras) * len(differences)))
        np.add.at(sums, _nearest(clock, each.stamps), parts)
    return total + sums


def _nearest(clock: Sums, stamps: Sums) -> npt.NDArray[np.intp]:
    """Return the place in ``clock``, ``(T,)``, that is nearest to each of ``(n,)`` stamps."""
    order = np.argsort(clock, kind="stable")
    rising = clock[order]
    after = np.clip(np.searchsorted(rising, stamps), 1, max(len(clock) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(clock) - 1)
    return order[np.where(stamps - rising[before] <= rising[after] - stamps, before, after)]


def holm(family: Sequence[Difference]) -> list[Difference]:
    """Return differences with p-values corrected so that a false finding among them is rare.

    If no difference of the family is real, the probability that any corrected p-value is below
    ``a`` is at most ``a``, however the comparisons depend on each other [1]_. A difference without
    a p-value is not counted, nor is one that is 0 on every unit: nothing can be found there.

    References
    ----------
    .. [1] S. Holm, A Simple Sequentially Rejective Multiple Test Procedure, Scandinavian Journal
       of Statistics 6, 1979, 65-70.
    """
    tested = sorted(
        (each.p, place)
        for place, each in enumerate(family)
        if each.p is not None and not each.is_zero
    )
    found, least = list(family), 0.0
    for rank, (p, place) in enumerate(tested):
        least = max(least, min((len(tested) - rank) * p, 1.0))
        found[place] = replace(family[place], p_holm=least, comparisons=len(tested))
    return found


def benjamini_hochberg(values: Sequence[float | None]) -> list[float | None]:
    """Correct p-values so that few of the findings are false.

    Of those whose corrected value is at most ``q``, a share of at most ``q`` is false on average:
    ``min over j >= i of p_(j) m / j``, for the i-th smallest of m [1]_. That holds where the tests
    are independent, as those of different drives are, or depend on each other positively. None is
    what was not tested: it is not counted and stays None.

    References
    ----------
    .. [1] Y. Benjamini, Y. Hochberg, Controlling the False Discovery Rate, Journal of the Royal
       Statistical Society B 57, 1995, 289-300.
    """
    tested = sorted((p, place) for place, p in enumerate(values) if p is not None)
    corrected: list[float | None] = [None] * len(values)
    least = 1.0
    for rank, (p, place) in reversed([*enumerate(tested, start=1)]):
        least = min(least, p * len(tested) / rank)
        corrected[place] = least
    return corrected
