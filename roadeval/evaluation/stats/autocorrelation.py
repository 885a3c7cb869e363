"""The mean of a series in which neighbours resemble each other, and its uncertainty.

A series is a first-order autoregression plus noise that is new on each frame. The coefficient and
the noise's share of the variance are unknown: a grid of both is tried, and each model is weighted
by how well it explains the slowest cosine coefficients of the series except the mean [1]_. Given a
model, the mean has Student's distribution; over all models it has a mixture of these distributions.
The result is a Student's distribution again: its precision is the average of the models', and its
degrees of freedom are chosen for the 95 % interval of the mixture. Farther out the mixture is
dominated by unlikely models with huge errors, which would hide any finding. Skewed series bend the
distribution [2]_: a drive that met few bursts has a mean that is too low *and* a spread that is too
small.

``benchmarks/INTERVALS.md`` compares how often these and textbooks' intervals hold. They do
not allow for drift that noise hides on a short drive, for drift that takes longer than the drive,
or for bursts that are rare on a drive. In these cases three or four of five intervals hold instead
of nineteen of twenty, and p-values are too small.

References
----------
.. [1] U. K. Müller, M. W. Watson, Measuring Uncertainty about Long-Run Predictions, Review of
   Economic Studies 83, 2016, 1711-1740.
.. [2] P. Hall, On the Removal of Skewness by Transformation, Journal of the Royal Statistical
   Society B 54, 1992, 221-228.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from roadeval.data.arrays import Floats

_TAIL: Final = 0.025
"""Probability of each tail, where Student's distribution and the mixture have the same limits."""
_SHARES: Final = (1, 0.95, 0.75, 0.5, 0.25)
"""The shares of the variance that are tried for the autoregression."""


class MeanDistribution(NamedTuple):
    """Student's distribution of a mean, skewed, given a series.

    An interval holds the values with a p-value of at least one minus the confidence.
    """

    mean: float
    standard_error: float
    degrees: float
    """An interval is ``mean ± t(degrees) standard_error``, skewness aside."""
    effective: float
    """Number of independent values that would determine the mean equally well."""
    skewness: float = 0.0
    """Skewness of the mean."""

    def p_value(self, value: float = 0.0) -> float:
        """Return the two-sided p-value of the hypothesis that the mean is ``value``."""
        from scipy.special import stdtr

        if not self.standard_error:
            return float(self.mean == value)
        t, s = (self.mean - value) / self.standard_error, self.skewness
        symmetric = t + s * t**2 / 3 + s**2 * t**3 / 27 + s / 6
        return float(2 * stdtr(self.degrees, -abs(symmetric)))

    def interval(self, confidence: float) -> tuple[float, float]:
        """Return the lowest and the highest value with the p-value ``1 - confidence``."""
        from scipy.special import stdtrit

        t, s = float(stdtrit(self.degrees, (1 + confidence) / 2)), self.skewness
        ends = [t, -t]
        if abs(s) >= 1e-6:
            ends = [3 / s * (math.cbrt(1 + s * (end - s / 6)) - 1) for end in ends]
        return self.mean - self.standard_error * ends[0], self.mean - self.standard_error * ends[1]


def mean_distribution(
    series: Floats, *, independent: bool = False, factors: Floats | None = None
) -> MeanDistribution:
    """Estimate the mean of a stationary process from a stretch of it, ``(n,)``, n at least 4.

    Values that are ``independent`` by design give the Student's distribution of textbooks. With
    ``factors``, ``(n,)``, the sum of values times factors is estimated instead, for example the
    difference of two parts' means: the slower factors change, the more it has of the slow errors.
    """
    from scipy.fft import dct
    from scipy.special import beta, stdtr, stdtridf, stdtrit

    n = len(series)
    mean = float(series.mean() if factors is None else factors @ series)
    if np.ptp(series) == 0:
        return MeanDistribution(mean, 0.0, n - 1, n)
    if independent:
        return MeanDistribution(mean, float(series.std(ddof=1)) / math.sqrt(n), n - 1, n)
    precisions, log_factor, of_mean = _models(n)
    if factors is not None:
        spectrum = np.fft.rfft(factors, 2 * n)
        products = np.fft.irfft(np.abs(spectrum) ** 2)[:n]
        powers = (1 - _distances(n))[:, None] ** np.arange(1, n)
        slow, white = products[0] + 2 * powers @ products[1:], products[0]
        of_mean = np.concatenate([share * slow + (1 - share) * white for share in _SHARES])
    count = precisions.shape[1]
    variances = precisions @ dct(series, norm="ortho")[1 : count + 1] ** 2 / count
    fit = log_factor - count / 2 * np.log(variances)
    weights = np.exp(fit - fit.max())
    weights /= weights.sum()
    errors = np.sqrt(of_mean * variances)
    error = float(weights @ errors**-2) ** -0.5
    # The mixture's interval, by Newton's method. It starts from Student's interval, which is
    # narrower; tails are convex, so no step is too long.
    norm = math.sqrt(count) * beta(0.5, count / 2)
    half, step = float(stdtrit(count, 1 - _TAIL)) * error, math.inf
    while step > 1e-13 * half:
        t = half / errors
        density = (1 + t**2 / count) ** (-(count + 1) / 2) / norm
        step = float(weights @ stdtr(count, -t) - _TAIL) / float(weights @ (density / errors))
        half += step
    degrees = float(stdtridf(_TAIL, -half / error))
    effective = min(float(series.var()) / error**2, n)
    if factors is not None:
        return MeanDistribution(mean, error, degrees, effective)
    centred = series - mean
    skewness = float((centred**3).mean() / (centred**2).mean() ** 1.5)
    # Shrunk towards 0 unless it far exceeds its standard error, as of independent normal values.
    skewness = skewness**3 / (skewness**2 + 6 / effective) / math.sqrt(effective)
    return MeanDistribution(mean, error, degrees, effective, skewness)


@lru_cache(maxsize=8)
def _models(n: int) -> tuple[Floats, Floats, Floats]:
    """Return the properties of the ``g`` models of the grid, for series of length ``n``.

    They are the inverse variances of the cosine coefficients for a variance of 1, ``(g, m)``;
    the logarithm of each model's prior weight times the factor of the likelihood that depends on
    the model only, ``(g,)``; and the variance of the mean, ``(g,)``.
    """
    # Coefficients reach from 0 to a memory of ten lengths, and are denser near 1, where they matter
    # most. The prior is uniform, so their weights are proportional to the distance from 1.
    distance = _distances(n)
    # Prior of `_SHARES`: 1 is as likely as all other shares together.
    likely = np.array([0.5, 0.06, 0.12, 0.12, 0.2])
    count = min(max(90, round(2.5 * math.sqrt(n))), n - 1)
    slow = cosine_variances(1 - distance, count + 1, n)
    of_mean, *variances = np.concatenate([share * slow + (1 - share) for share in _SHARES]).T
    prior = np.log(np.outer(likely, distance).ravel())
    return 1 / np.transpose(variances), prior - np.log(variances).sum(axis=0) / 2, of_mean / n


def _distances(n: int) -> Floats:
    """Return the coefficients that are tried, as their distances from 1."""
    return np.asarray((10.0 * n) ** -np.linspace(0, 1, 48))


def cosine_variances(coefficients: Floats, count: int, n: int) -> Floats:
    """Compute variances of the slowest orthonormal cosine coefficients (DCT-II), ``(g, count)``.

    They are exact for stationary autoregressions of variance 1 and length ``n``: the spectrum minus
    the effect of the two ends. ``coefficients`` are ``(g,)``, at least 0 and below 1. The first
    variance divided by ``n`` is the variance of the mean.
    """
    r, numbers = coefficients[:, None], np.arange(count)
    angle = np.pi * numbers / n
    gain = (1 - r) ** 2 + 4 * r * np.sin(angle / 2) ** 2
    alternating = r**n * np.where(numbers % 2, -1, 1)
    ends = np.where(numbers, 4, 2) * r / n * ((1 - r) * np.cos(angle / 2)) ** 2 * (1 - alternating)
    return np.asarray((1 - r**2) / gain - ends / gain**2)
