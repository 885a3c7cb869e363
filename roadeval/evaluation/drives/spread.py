"""How far drives lie from each other, their own errors set aside: a random-effects model.

A drive's true difference is drawn from a distribution of variance ``tau^2``; its measured one adds
an error of the drive's own variance ``s_i^2``. With weights ``w_i = 1 / (tau^2 + s_i^2)`` and the
weighted mean ``m``, ``Q(tau^2) = sum w_i (y_i - m)^2`` is n - 1 on average at the true ``tau``, and
falls with it. Paule and Mandel's estimate is where it is n - 1 [1]_; the interval holds every
``tau`` at which it is no rare value of its distribution, the Q-profile [2]_. That is chi-squared
where drives are normal. Where they are not, Q varies more, and intervals that ignore this hold the
less often, the more drives there are; so the degrees of freedom are reduced by the excess kurtosis
of the drives, ``(n - 1) / (1 + g (n - 1) / (2 n))`` [3]_.

Drives of a group are no independent draws. One drive is drawn from each group, so that they are,
and the medians of many such draws are given [4]_: the spread is that of single drives, within and
between groups, and the interval is as wide as the number of groups makes it.

A new drive, of a group that is not here, differs by a draw of variance ``tau^2`` from a mean that
is not known either. ``tau`` has the distribution whose quantiles are the ends of Q-profile
intervals [5]_; what is given holds for the mixture over it.

References
----------
.. [1] R. C. Paule, J. Mandel, Consensus Values and Weighting Factors, Journal of Research of the
   National Bureau of Standards 87, 1982, 377-385.
.. [2] W. Viechtbauer, Confidence Intervals for the Amount of Heterogeneity in Meta-Analysis,
   Statistics in Medicine 26, 2007, 37-52.
.. [3] B. O'Neill, Some Useful Moment Results in Sampling Problems, The American Statistician 68,
   2014, 282-296, for the variance of a sample's variance that the factor stands for.
.. [4] E. B. Hoffman, P. K. Sen, C. R. Weinberg, Within-Cluster Resampling, Biometrika 88, 2001,
   1121-1134.
.. [5] K. Nagashima, H. Noma, T. A. Furukawa, Prediction Intervals for Random-Effects
   Meta-Analysis: A Confidence Distribution Approach, Statistical Methods in Medical Research 28,
   2019, 1689-1702.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from roadeval.evaluation.drives.effect import Clusters, Values
from roadeval.evaluation.drives.settings import AcrossSettings
from roadeval.runtime.extensions import special

_DRAWS: Final = 50
_DRAWN: Final = 50_000
"""One drive of each group is drawn so often, unless these many drives are drawn before that."""
_LEVELS: Final = 16
"""Quantiles that stand for the distribution of ``tau``."""
_LEAST_ERROR: Final = 1e-6
"""A drive whose error is smaller than this, in the greatest error or distance, has this one."""
_STEPS: Final = 100


@dataclass(frozen=True, slots=True)
class Spread:
    """How far drives lie from each other. Fractions.

    Parameters
    ----------
    tau, tau_low, tau_high
        Standard deviation of the drives' true differences, and its interval.
    share
        ``tau^2`` in the variance of what a typical drive measures, I^2: how much of what is seen
        is between drives, and not the error of each.
    new_low, new_high
        Between these the true difference of a new drive is expected, of a group that is not here.
    drives, clusters
        With a standard error, which alone are used.
    """

    tau: float
    tau_low: float
    tau_high: float
    share: float
    new_low: float
    new_high: float
    drives: int
    clusters: int


def spread_of(clusters: Clusters, settings: AcrossSettings) -> Spread | None:
    """Compute how far drives lie from each other; None below `AcrossSettings.least_clusters`."""
    used = Clusters.of(each for each in clusters.effects if each.standard_error is not None)
    if len(used) < settings.least_clusters:
        return None
    measured, variances = _draws(used, settings.seed)
    free = len(used) - 1
    estimate = tau_squared(measured, variances, np.full((len(measured), 1), float(free)))
    profile = tau_squared(measured, variances, _targets(measured, variances + estimate, settings))
    means = used.group_means()
    errors = np.sqrt(profile[:, 2:] + means.var(ddof=1) / len(means))
    half = _half_width(errors, free, settings.confidence)
    low, high = np.sqrt(np.median(profile[:, :2], axis=0))
    return Spread(
        tau=math.sqrt(float(np.median(estimate))),
        tau_low=float(low),
        tau_high=float(high),
        share=float(np.median(_share(estimate[:, 0], variances))),
        new_low=float(means.mean()) - half,
        new_high=float(means.mean()) + half,
        drives=len(used.effects),
        clusters=len(used),
    )


def tau_squared(measured: Values, variances: Values, targets: Values) -> Values:
    """Compute the ``tau^2`` at which Q is each target; 0 where it is below that everywhere.

    By Newton's steps from 0, which approach it from below, for Q is convex.

    Parameters
    ----------
    measured, variances
        ``(r, n)``: of r fleets of n drives; variances above 0.
    targets
        ``(r, t)``.

    Returns
    -------
    array
        ``(r, t)``.
    """
    measured, variances = measured[:, None, :], variances[:, None, :]
    found = np.zeros(targets.shape)
    for _ in range(_STEPS):
        weights = 1 / (found[..., None] + variances)
        middle = (weights * measured).sum(axis=-1) / weights.sum(axis=-1)
        parts = weights * (measured - middle[..., None]) ** 2
        gap = parts.sum(axis=-1) - targets
        slope = (weights * parts).sum(axis=-1)
        step = np.divide(gap, slope, out=np.zeros(gap.shape), where=gap > 0)
        found += step
        if (step <= 1e-10 * found).all():
            break
    return found


def _draws(used: Clusters, seed: int) -> tuple[Values, Values]:
    """Return drawn fleets, one drive of each group: what they measured, and their variances.

    One fleet is enough where no group has two drives.
    """
    count = 1
    if used.sizes.max() > 1:
        count = min(_DRAWS, max(_DRAWN // len(used), 5))
    share = np.random.default_rng(seed).random((count, len(used)))
    places = used.starts + (share * used.sizes).astype(np.intp)
    errors = np.array([each.standard_error for each in used.effects], np.float64)
    least = _LEAST_ERROR * max(float(errors.max()), float(np.ptp(used.means)))
    errors = np.maximum(errors, least or 1.0)
    return used.means[places], errors[places] ** 2


def _targets(measured: Values, totals: Values, settings: AcrossSettings) -> Values:
    """Return the values of Q at both ends of the interval, and at each level of ``tau``."""
    count = measured.shape[1]
    tail = (1 - settings.confidence) / 2
    levels = [1 - tail, tail, *((np.arange(_LEVELS) + 0.5) / _LEVELS)]
    degrees = (count - 1) / (1 + _excess(measured, totals) * (count - 1) / (2 * count))
    # chdtri takes the share that lies above.
    quantiles = special("chdtri")(degrees[:, None], 1 - np.array(levels))
    targets: Values = (count - 1) / degrees[:, None] * quantiles
    return targets


def _excess(measured: Values, totals: Values) -> Values:
    """Return the excess kurtosis of drives in their own errors, ``(r,)``, at least 0.

    The usual estimate (G2), which is unbiased where they are normal.
    """
    count = measured.shape[1]
    middle = (measured / totals).sum(axis=1) / (1 / totals).sum(axis=1)
    squares = (measured - middle[:, None]) ** 2 / totals
    square = squares.mean(axis=1) ** 2
    ratio = np.divide(
        (squares**2).mean(axis=1), square, out=np.full(len(square), 3.0), where=square > 0
    )
    excess = (count - 1) / ((count - 2) * (count - 3)) * ((count + 1) * (ratio - 3) + 6)
    clipped: Values = np.maximum(excess, 0)
    return clipped


def _share(estimate: Values, variances: Values) -> Values:
    """Compute I^2, ``(r,)``: ``tau^2 / (tau^2 + s^2)`` with a typical drive's variance.

    That is ``(n - 1) sum w / ((sum w)^2 - sum w^2)``, ``w = 1 / s_i^2`` (J. P. T. Higgins, S. G.
    Thompson, Statistics in Medicine 21, 2002, 1539-1558, equation 9).
    """
    weights = 1 / variances
    total = weights.sum(axis=1)
    typical = (weights.shape[1] - 1) * total / (total**2 - (weights**2).sum(axis=1))
    share: Values = estimate / (estimate + typical)
    return share


def _half_width(errors: Values, degrees: int, confidence: float) -> float:
    """Return half the width of the interval of a mixture of Student's distributions."""
    low, high = 0.0, float(special("stdtrit")(degrees, (1 + confidence) / 2) * errors.max())
    while high - low > 1e-9 * high:
        middle = (low + high) / 2
        beyond = 2 * float(special("stdtr")(degrees, -middle / errors).mean())
        low, high = (middle, high) if beyond > 1 - confidence else (low, middle)
    return high
