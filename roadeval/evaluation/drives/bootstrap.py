"""The difference of pooled rates over drives, and its interval by a bootstrap of groups.

A fleet is drawn anew by drawing its groups with replacement, each with all its drives. The interval
is the percentile interval, widened as Student's is wider than the normal one [1]_: with few groups
the plain one is too narrow, and so is BCa [2]_. Both stand beside it in the table of
`roadeval.evaluation.drives.across`.

References
----------
.. [1] T. C. Hesterberg, What Teachers Should Know About the Bootstrap, The American Statistician
   69, 2015, 371-386, section 4.3 ("expanded percentile interval").
.. [2] B. Efron, Better Bootstrap Confidence Intervals, Journal of the American Statistical
   Association 82, 1987, 171-185.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.evaluation.drives.effect import Clusters, Values
from roadeval.evaluation.drives.settings import AcrossSettings
from roadeval.runtime.extensions import special

_AT_ONCE: Final = 100_000
"""Groups that are drawn at a time, which then fit into a processor's cache."""


def pooled_counts(clusters: Clusters) -> Values | None:
    """Return each group's counts, ``(c, 4)``: both of the base, both of the new; None if unknown.

    They are unknown where one drive's are, for the rest would be another fleet.
    """
    rows = [
        (*each.base_counts, *each.new_counts)
        for each in clusters.effects
        if each.base_counts is not None and each.new_counts is not None
    ]
    if not rows or len(rows) < len(clusters.effects):
        return None
    return clusters.sums(np.array(rows, np.float64))


def pooled_difference(sums: Values) -> Values:
    """Compute ``new[0] / new[1] - base[0] / base[1]`` of summed counts, ``(..., 4)``."""
    with np.errstate(invalid="ignore", divide="ignore"):
        differences: Values = sums[..., 2] / sums[..., 3] - sums[..., 0] / sums[..., 1]
    return differences


def pooled_interval(counts: Values, settings: AcrossSettings) -> tuple[float, float]:
    """Compute the interval of the difference of pooled rates.

    Parameters
    ----------
    counts
        ``(c, 4)`` counts of c groups, c at least 2.

    Returns
    -------
    tuple of float
        Its ends. The same for the same counts and seed.
    """
    groups = len(counts)
    quantile = special("stdtrit")(groups - 1, (1 + settings.confidence) / 2)
    tail = float(special("ndtr")(-math.sqrt(groups / (groups - 1)) * quantile))
    low, high = np.quantile(resampled(counts, settings), [tail, 1 - tail])
    return float(low), float(high)


def resampled(counts: Values, settings: AcrossSettings) -> Values:
    """Compute the difference of pooled rates of each drawn fleet, where it is defined.

    Two counts travel as one complex number, which halves the time that gathering them takes.
    """
    rng, groups = np.random.default_rng(settings.seed), len(counts)
    base, new = np.ascontiguousarray(counts.view(np.complex128).T)
    smallest: npt.DTypeLike = np.min_scalar_type(groups - 1)
    sums = np.empty((settings.resamples, 2), np.complex128)
    for some in np.array_split(sums, math.ceil(len(sums) * groups / _AT_ONCE)):
        places = rng.integers(groups, size=(len(some), groups), dtype=smallest).astype(np.intp)
        some[:, 0], some[:, 1] = base[places].sum(axis=1), new[places].sum(axis=1)
    differences = pooled_difference(sums.view(np.float64))
    return differences[np.isfinite(differences)]
