"""Phase 1, colour similarity (section 3.1): Mahalanobis distance to the road's colour (Eq. 2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
from pydantic import Field

from roadeval.data import Layer, LayerKind, LayerSpec, Packed, mask_spec
from roadeval.data.arrays import Floats
from roadeval.kernels import KERNELS
from roadeval.pipeline import stage
from roadeval.pipeline.stage import Output, Stage, TrainingSet, View

RIDGE: Final = 1.0
"""Added to the covariance's diagonal, in squared grey levels: a grey camera's covariance is
singular. 1 is about the variance that 8-bit JPEG coding alone adds; with much less than 0.001 the
inverse of a singular covariance is lost in rounding."""
SIMILARITY: Final = mask_spec("similarity", "Similar to road (Eq. 2)")


@stage.stage_settings
class SimilaritySettings:
    """Settings of phase 1.

    quantile: A pixel is road if ``d^2`` is at most this quantile of the chi-squared distribution
        with 3 degrees of freedom: the share of normally distributed road colours that count as
        road.
    """

    quantile: Annotated[float, Field(gt=0, lt=1)] = 0.95


@dataclass(frozen=True, eq=False)
class RoadColour:
    """Mean ``(3,)`` and covariance ``(3, 3)`` of the road training set, RGB in 0..255."""

    mean: Floats
    covariance: Floats

    def __post_init__(self) -> None:
        stage.check_arrays(self, np.float64, mean=(3,), covariance=(3, 3))
        stage.check_range("mean", self.mean, 0, 255)
        stage.check_range("covariance", self.covariance, -(255**2), 255**2)
        # A single grey level has no variance; rounding may make it slightly negative.
        if np.linalg.eigvalsh(self.covariance)[0] < -1e-6:
            raise ValueError("covariance is not positive semi-definite")
        if not np.allclose(self.covariance, self.covariance.T):
            raise ValueError("covariance is not symmetric")


def fit(sample: TrainingSet, _settings: SimilaritySettings) -> RoadColour:
    """Estimate m and S of Eq. 2 from the road pixels of the training set."""
    road = sample.colours()[sample.road].astype(np.float64)
    return RoadColour(road.mean(axis=0), np.cov(road, rowvar=False, ddof=0))


def limit(quantile: float) -> float:
    """Return the greatest ``d^2`` of a road pixel: ``chi2.ppf(quantile, 3)``."""
    from scipy.special import chdtri

    # The same number as scipy.stats.chi2.ppf, whose import takes a second.
    return float(chdtri(3, 1.0 - quantile))


def whitening(covariance: Floats) -> Floats:
    """Return W, ``(3, 3)`` lower triangular, of a positive covariance S: ``W^T W = S^-1``.

    So the distance of Eq. 2 is ``|W (x - m)|``, which rounding can neither make negative nor blow
    up: even if only the ridge keeps S from being singular, its error is below 0.01 in single
    precision.
    """
    return np.tril(np.linalg.inv(np.linalg.cholesky(covariance)))


def bind(settings: SimilaritySettings, road: RoadColour) -> Callable[[View], Output]:
    """Return phase 1 as a pure function of a view (Eq. 2).

    ``d = sqrt((x - m)^T S^-1 (x - m))`` with S regularised. The printed Eq. 2 is not a distance
    (its brackets are misplaced).
    """
    factors, greatest = whitening(road.covariance + RIDGE * np.eye(3)), limit(settings.quantile)
    spec, _ = layers(settings)

    def run(view: View) -> Output:
        distance, near = KERNELS.mahalanobis(view.planes, road.mean, factors, greatest)
        mask = Packed.of(near)
        return Output((Layer(spec, distance), Layer(SIMILARITY, mask)), mask=mask)

    return run


def layers(settings: SimilaritySettings) -> tuple[LayerSpec, LayerSpec]:
    """Return the layers of phase 1: the distance is shown from 0 to three times the limit."""
    span = (0.0, 3.0 * limit(settings.quantile) ** 0.5)
    title = "Mahalanobis distance to road (Eq. 2)"
    distance = LayerSpec(
        "distance", LayerKind.SCALAR, title, value_range=span, exact=False, photographic=True
    )
    return distance, SIMILARITY


STAGE: Final = Stage(
    name="similarity",
    title="Phase 1: colour similarity",
    settings=SimilaritySettings,
    bind=bind,
    layers=layers,
    fit=fit,
    parameters=RoadColour,
    inference_only=("quantile",),
)
