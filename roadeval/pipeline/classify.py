"""Phase 3, the support vector machine on each pixel's colour (section 3.3, Eq. 12-16)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final, Literal

import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as validated

from roadeval.data import Layer, LayerSpec, Mask, Rgb, mask_spec
from roadeval.pipeline.fast import KERNELS
from roadeval.pipeline.stage import Output, Stage, TrainingSet, View

Floats = npt.NDArray[np.float64]

SVM: Final = mask_spec("svm", "SVM: road (Eq. 16)")

UNKNOWN: Final = 255
"""Entry of a `ColourClassifier`'s table whose colour has not been met yet."""
_BLOCK: Final = 1 << 20
"""Kernel values computed at once: 8 MB of float64, which stays in the cache."""


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class SvmSettings:
    """Settings of phase 3.

    Parameters
    ----------
    kernel
        ``rbf``, an adaptation of the printed machine: road is a mid grey between dark verges
        and bright sky, which no plane in RGB cuts out; or ``linear``, as printed (Eq. 12).
    c
        Penalty of a training pixel on the wrong side. The printed Eq. 13 allows none, which
        has no solution for classes that overlap.
    gamma
        Width of the RBF kernel ``exp(-gamma |x - y|^2)``, in standardised colours.
    standardise
        Whether colours are brought to mean 0 and deviation 1 over the training set.
    threshold
        A pixel is road where the decision function is above this.
    """

    kernel: Literal["rbf", "linear"] = "rbf"
    c: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0
    gamma: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 0.5
    standardise: bool = True
    threshold: Annotated[float, Field(allow_inf_nan=False)] = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class SupportVectors:
    """A fitted machine (Eq. 15-16).

    Parameters
    ----------
    mean, scale
        ``(3,)``: features are ``(colour - mean) / scale``, colours in 0..255.
    vectors
        ``(m, 3)``: the support vectors x_i, as features.
    weights
        ``(m,)``: their ``lambda_i y_i``, y = 1 for road and -1 otherwise.
    offset
        b.
    """

    mean: Floats
    scale: Floats
    vectors: Floats
    weights: Floats
    offset: float


def fit(sample: TrainingSet, settings: SvmSettings) -> SupportVectors:
    """Solve the dual (Eq. 14) for the training set's colours with scikit-learn's libsvm."""
    from sklearn.svm import SVC

    colours = sample.colours().astype(np.float64)
    mean, scale = np.zeros(3), np.ones(3)
    if settings.standardise:
        mean, scale = colours.mean(axis=0), colours.std(axis=0)
        scale = np.where(scale > 0, scale, 1.0)
    machine = SVC(C=settings.c, kernel=settings.kernel, gamma=settings.gamma)
    machine.fit((colours - mean) / scale, sample.road)
    return SupportVectors(
        mean,
        scale,
        np.ascontiguousarray(machine.support_vectors_),
        np.ascontiguousarray(machine.dual_coef_[0]),
        float(machine.intercept_[0]),
    )


def decision(
    colours: npt.NDArray[np.uint8], machine: SupportVectors, settings: SvmSettings
) -> Floats:
    """Decision value ``sum_i lambda_i y_i K(x, x_i) + b`` of ``(n, 3)`` colours (Eq. 16).

    Returns ``(n,)`` float64, equal to scikit-learn's ``decision_function`` up to rounding.
    """
    features = (colours - machine.mean) / machine.scale
    if settings.kernel == "linear":
        # Eq. 15: the machine's plane, w = sum_i lambda_i y_i x_i.
        plane: Floats = features @ (machine.weights @ machine.vectors) + machine.offset
        return plane
    result = np.empty(len(features))
    rows = max(1, _BLOCK // max(1, len(machine.vectors)))
    for start in range(0, len(features), rows):
        block = features[start : start + rows]
        kernel = _squared_distances(block, machine.vectors)
        kernel *= -settings.gamma
        np.exp(kernel, out=kernel)
        result[start : start + rows] = kernel @ machine.weights + machine.offset
    return result


def _squared_distances(a: Floats, b: Floats) -> Floats:
    """``(n, m)`` squared Euclidean distances between the rows of two ``(., 3)`` arrays."""
    distances = a @ (-2.0 * b.T)
    distances += (a * a).sum(axis=1)[:, None]
    distances += (b * b).sum(axis=1)[None, :]
    return distances


class ColourClassifier:
    """Eq. 16 as a table over the 2^24 colours, filled as colours are met.

    A pixel's features are its three colours alone, so a drive's few hundred thousand distinct
    colours are all that is ever evaluated, each once and exactly. An entry depends on nothing
    but its colour: threads may share the table, and at worst compute one twice.
    """

    def __init__(self, machine: SupportVectors, settings: SvmSettings) -> None:
        self._machine = machine
        self._settings = settings
        self._table = np.full(1 << 24, UNKNOWN, np.uint8)

    def __call__(self, image: Rgb) -> Mask:
        """Classify an ``(H, W, 3)`` uint8 RGB image: ``(H, W)`` uint8, 1 for road."""
        mask: Mask = KERNELS.look_up_colours(image, self._table)
        unknown = mask == UNKNOWN
        if unknown.any():
            self._learn(image[unknown])
            mask[unknown] = KERNELS.look_up_colours(image[unknown][None], self._table)[0]
        return mask

    def _learn(self, colours: npt.NDArray[np.uint8]) -> None:
        wide = colours.astype(np.int32)
        index = np.unique((wide[:, 0] << 16) | (wide[:, 1] << 8) | wide[:, 2])
        distinct = np.stack([index >> 16, (index >> 8) & 255, index & 255], axis=1)
        values = decision(distinct.astype(np.uint8), self._machine, self._settings)
        self._table[index] = values > self._settings.threshold


def bind(settings: SvmSettings, machine: SupportVectors) -> Callable[[View], Output]:
    """Return phase 3 as a pure function of what it sees."""
    classify = ColourClassifier(machine, settings)

    def run(view: View) -> Output:
        mask = classify(view.image)
        return Output((Layer(SVM, mask),), mask=mask)

    return run


def layers(_settings: SvmSettings) -> tuple[LayerSpec, ...]:
    """Name the layer of phase 3."""
    return (SVM,)


STAGE: Final = Stage(
    name="svm",
    title="Phase 3: support vector machine",
    settings=SvmSettings,
    bind=bind,
    layers=layers,
    fit=fit,
    parameters=SupportVectors,
)
