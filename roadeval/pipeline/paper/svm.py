"""Phase 3, the support vector machine on each pixel's colour (section 3.3, Eq. 12-16)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from roadeval.data import Layer, Packed, mask_spec
from roadeval.data.arrays import Floats, Plane, Words
from roadeval.kernels import KERNELS
from roadeval.pipeline import stage
from roadeval.pipeline.colour_table import (
    EPS,
    LEVELS,
    Margins,
    sums_of_products,
    sums_of_terms,
    table_of,
)
from roadeval.pipeline.stage import Output, Stage, TrainingSet, View

SVM: Final = mask_spec("svm", "SVM: road (Eq. 16)")

Penalty = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]
"""C of a soft margin. It bounds the machine's weights, which must stay far below `GREATEST`."""

_BLOCK: Final = 1 << 17
"""Kernel values computed at once: 1 MB of float64; a few such arrays fit in the cache."""


@stage.stage_settings
class SvmSettings:
    """Settings of phase 3.

    kernel: ``rbf``, an adaptation of the printed machine: road is a mid grey between dark verges
        and bright sky, which no plane in RGB separates; or ``linear``, as printed (Eq. 12).
    c: Penalty of a training pixel on the wrong side. The printed Eq. 13 allows none, which has no
        solution for classes that overlap.
    gamma: Width of the RBF kernel ``exp(-gamma |x - y|^2)``, in standardised colours.
    threshold: A pixel is road if the decision function is above this.
    """

    kernel: Literal["rbf", "linear"] = "rbf"
    c: Penalty = 1.0
    gamma: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 0.5
    threshold: Annotated[float, Field(allow_inf_nan=False)] = 0.0


@dataclass(frozen=True, eq=False)
class SupportVectors:
    """A fitted machine (Eq. 15-16)."""

    mean: Floats
    """``(3,)``, of colours in 0..255."""
    scale: Floats
    """``(3,)``: features are ``(colour - mean) / scale``."""
    vectors: Floats
    """``(m, 3)``: the support vectors x_i, as features."""
    weights: Floats
    """``(m,)``: their ``lambda_i y_i``, y = 1 for road and -1 otherwise."""
    offset: float
    """B."""

    def __post_init__(self) -> None:
        shapes = {"mean": (3,), "scale": (3,), "vectors": ("m", 3), "weights": ("m",)}
        stage.check_arrays(self, np.float64, **shapes, offset=())
        stage.check_range("mean", self.mean, 0, 255)
        stage.check_range("scale", self.scale, 1e-6, 255)


def fit(sample: TrainingSet, settings: SvmSettings) -> SupportVectors:
    """Solve the dual (Eq. 14) for the training set's colours with scikit-learn's libsvm.

    Colours are brought to mean 0 and deviation 1 over the training set.
    """
    colours = sample.colours().astype(np.float64)
    mean, scale = colours.mean(axis=0), colours.std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    features = (colours - mean) / scale
    from sklearn.svm import SVC

    machine = SVC(C=settings.c, kernel=settings.kernel, gamma=settings.gamma)
    machine.fit(features, sample.road)
    vectors, weights = map(np.ascontiguousarray, (machine.support_vectors_, machine.dual_coef_[0]))
    return SupportVectors(mean, scale, vectors, weights, float(machine.intercept_[0]))


def decision(colours: Plane, machine: SupportVectors, settings: SvmSettings) -> Floats:
    """Compute ``sum_i lambda_i y_i K(x, x_i) + b`` of ``(n, 3)`` uint8 colours (Eq. 16).

    Returns ``(n,)`` float64, equal to scikit-learn's ``decision_function`` up to rounding. A
    colour's value does not depend on the colours that it is computed with.
    """
    features = (colours - machine.mean) / machine.scale
    if settings.kernel == "linear":
        # Eq. 15: the machine's plane, w = sum_i lambda_i y_i x_i.
        terms = features * (machine.weights @ machine.vectors)
        return terms.sum(axis=1) + machine.offset
    result = np.empty(len(features))
    rows = max(1, _BLOCK // max(1, len(machine.vectors)))
    for start in range(0, len(features), rows):
        block = slice(start, start + rows)
        pairs = zip(features[block].T, machine.vectors.T, strict=True)
        squared = sum((feature[:, None] - vector) ** 2 for feature, vector in pairs)
        # Row by row: the rounding of a matrix product's row depends on the other rows.
        terms = np.exp(-settings.gamma * squared) * machine.weights
        result[block] = terms.sum(axis=1) + machine.offset
    return result


@lru_cache(maxsize=4)
def colour_table(machine: SupportVectors, settings: SvmSettings) -> Words:
    """Return the decision of Eq. 16 for every colour there is.

    A pixel's features are its three channels alone, so that the table replaces the machine. The
    last four tables stay in memory, each 2 MiB, or 4 if many colours are undecided.
    """
    # Matrices this small gain nothing from threads, which only compete with other work.
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        return table_of(
            colour_margins(machine, settings),
            lambda colours: decision(colours, machine, settings) > settings.threshold,
        )


def colour_margins(machine: SupportVectors, settings: SvmSettings) -> Margins:
    """Return the decision values on the colour cube, less the threshold."""
    offset = machine.offset - settings.threshold

    def features(channel: int, levels: Floats) -> Floats:
        return (levels - machine.mean[channel]) / machine.scale[channel]

    def factor(channel: int, levels: Floats) -> Floats:
        away = features(channel, levels)[:, None] - machine.vectors[:, channel]
        return np.exp(-settings.gamma * away**2)

    every = np.stack([features(channel, LEVELS) for channel in range(3)])
    if settings.kernel == "linear":
        plane = machine.weights @ machine.vectors
        return sums_of_terms(plane[:, None] * every, offset)
    # A feature's error is a few roundings of the largest, and exp(-gamma x^2) is nowhere steeper
    # than sqrt(gamma).
    reach = float(max(np.abs(every).max(), np.abs(machine.vectors).max()))
    rounding = 8 * EPS * (1 + settings.gamma**0.5 * reach)
    return sums_of_products(machine.weights, factor, offset, rounding=rounding)


def bind(settings: SvmSettings, machine: SupportVectors) -> Callable[[View], Output]:
    """Return phase 3 as a pure function of a view."""
    table = colour_table(machine, settings)

    def run(view: View) -> Output:
        road = Packed.of(KERNELS.look_up_colours(view.planes, table))
        return Output((Layer(SVM, road),), mask=road)

    return run


STAGE: Final = Stage(
    name="svm",
    title="Phase 3: support vector machine",
    settings=SvmSettings,
    bind=bind,
    layers=(SVM,),
    fit=fit,
    parameters=SupportVectors,
    oracle=stage.perfect_mask,
    inference_only=("threshold",),
)
