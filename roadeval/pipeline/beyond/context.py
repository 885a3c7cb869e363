"""Phase 3 with more than colour: a support vector machine on colour, place, column and texture.

Two grey pixels of one colour, one of the road and one of a wall, differ in where they are, in what
surrounds them, and in what lies between them and the vehicle. The machine is the paper's
(Eq. 12-16) on a feature map that is written out: instead of a kernel,
``phi_k(x) = max(w_k . x + b_k, 0)``, planes of random direction through random pixels of the
training set [1]_, and a linear machine on phi. Its decision costs the same for every training set,
and it is evaluated on a working image.

References
----------
.. [1] A. Rahimi, B. Recht, Weighted Sums of Random Kitchen Sinks: Replacing Minimization with
   Randomization in Learning, NIPS 2008.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as validated

from roadeval.data import Layer, LayerKind, LayerSpec
from roadeval.data.arrays import Floats, Values
from roadeval.data.packed import Packed
from roadeval.kernels import KERNELS
from roadeval.pipeline.beyond.context_features import (
    BARE_FEATURES,
    at_samples,
    features,
    number_of_features,
)
from roadeval.pipeline.beyond.geodesic_features import GEODESICS, distance_of
from roadeval.pipeline.beyond.working_image import reduced, stretched
from roadeval.pipeline.paper.svm import NOT_RUN, SVM, Penalty
from roadeval.pipeline.parameters import GREATEST, check_arrays, check_range
from roadeval.pipeline.reference_patch import ReferencePatch
from roadeval.pipeline.stage import (
    MisfitError,
    Output,
    Stage,
    TrainingSet,
    View,
    perfect_mask,
)
from roadeval.runtime.extensions import extension, whole

_PRIMAL: Final = 2
"""liblinear's number for the primal problem with L2 penalty and squared hinge loss."""
_TOLERANCE: Final = 1e-4
_ROUNDS: Final = 1000

DECISION: Final = LayerSpec(
    "decision", LayerKind.SCALAR, "Decision value (Eq. 16)", value_range=(-2.0, 2.0), exact=False
)

GEODESIC: Final = LayerSpec(
    "geodesic",
    LayerKind.SCALAR,
    "Geodesic distance from the reference patch, over edges and hues",
    value_range=(0.0, 10.0),
    exact=False,
)


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class ContextSettings:
    """Settings of the machine.

    Parameters
    ----------
    width
        Of the working image: the machine decides there, and its decision values are interpolated.
    windows
        Sides of the squares over which texture is averaged, in its pixels. Gravel and leaves show
        in a small one; what a larger one tells of a facade, the columns below it tell as well.
        At most 8: for each number of features there is a loop of its own.
    geodesics
        Whether the distances from the reference patch along the cheapest path over edges, hues
        and colours are features, too: they grow by a step at a kerb.
    patch
        The reference patch, where those paths begin.
    planes
        Planes of the feature map. What a decision costs grows with them.
    spare
        Random planes drawn beyond those. The machine is solved on all of them first, and again on
        those that move decisions most: 96 of 128 planes decide as well as the 128.
    c
        Penalty of a training pixel on the wrong side.
    smoothing
        Side of the square over which decision values are averaged, in pixels of the working
        image: neighbours belong together. 1 leaves them as they are.
    threshold
        A pixel is road where the decision value is above this. None: learnt, see `threshold`.
    folds
        Parts of the training frames that are left out in turn to learn the threshold.
    """

    width: Annotated[int, Field(ge=32, le=4096)] = 320
    windows: Annotated[tuple[Annotated[int, Field(ge=1, le=255)], ...], Field(max_length=8)] = (5,)
    geodesics: bool = False
    patch: ReferencePatch = ReferencePatch()
    planes: Annotated[int, Field(ge=1, le=4096)] = 96
    spare: Annotated[int, Field(ge=0, le=4096)] = 32
    c: Penalty = 1.0
    smoothing: Annotated[int, Field(ge=1, le=255)] = 5
    threshold: Annotated[float, Field(allow_inf_nan=False)] | None = None
    folds: Annotated[int, Field(ge=2, le=100)] = 5

    @property
    def start(self) -> ReferencePatch | None:
        """Where geodesic paths begin; None if there are none."""
        return self.patch if self.geodesics else None


@dataclass(frozen=True, slots=True, eq=False)
class RectifiedMachine:
    """A fitted machine: ``sum_k weights[k] max(planes[k] . x + bias[k], 0) + offset``.

    ``planes`` is ``(K, F)``, ``bias`` and ``weights`` are ``(K,)``, all float32. A pixel is road
    where the sum is above ``threshold``.
    """

    planes: Values
    bias: Values
    weights: Values
    offset: float
    threshold: float

    def __post_init__(self) -> None:
        check_arrays(self, np.float32, planes=("K", "F"), bias=("K",), weights=("K",))
        check_arrays(self, np.float32, offset=(), threshold=())
        check_range("offset", self.offset, -GREATEST, GREATEST)
        more = self.planes.shape[1] - BARE_FEATURES
        if more < 0 or (more % 2 and more < GEODESICS):
            raise ValueError(
                "planes has not nine columns and two for each window of texture, or three more"
            )


# --- Learning -------------------------------------------------------------------------------------


def fit(sample: TrainingSet, settings: ContextSettings) -> RectifiedMachine:
    """Draw the planes, solve the linear machine (Eq. 13) on them, and learn the threshold."""
    values = at_samples(sample, settings.width, settings.windows, settings.start)
    planes, bias = draw_planes(values, settings.planes + settings.spare, sample.seed)
    mapped = np.maximum(values @ planes.T + bias, 0)
    kept, weights, offset = solve(mapped, sample.road, settings)
    learnt = settings.threshold
    if learnt is None:
        learnt = threshold(left_out(mapped, sample, settings), sample.road)
    return RectifiedMachine(planes[kept], bias[kept], weights.astype(np.float32), offset, learnt)


def draw_planes(values: Values, count: int, seed: int) -> tuple[Values, Values]:
    """Draw planes ``(count, F)`` and their bias ``(count,)`` for ``(n, F)`` features.

    Directions are uniform on the sphere of standardised features; each plane goes through a
    pixel of the training set, and is scaled so that its largest value there is 1.
    """
    rng = np.random.default_rng(seed)
    deviation = values.std(axis=0)
    planes = rng.normal(size=(count, values.shape[1]))
    planes /= np.linalg.norm(planes, axis=1, keepdims=True) * np.where(deviation > 0, deviation, 1)
    through = values[rng.integers(0, len(values), count)]
    bias = -(planes * through).sum(axis=1)
    largest = np.maximum((values @ planes.T + bias).max(axis=0), 1e-6)
    return (planes / largest[:, None]).astype(np.float32), (bias / largest).astype(np.float32)


def solve(
    mapped: Values, road: npt.NDArray[np.bool_], settings: ContextSettings
) -> tuple[npt.NDArray[np.intp], Floats, float]:
    """Solve the linear machine on the planes that move its decisions most.

    Parameters
    ----------
    mapped
        ``(n, K)``: what each plane makes of each pixel.
    road
        ``(n,)``: the pixels' labels.
    settings
        ``planes`` are kept. A plane moves decisions by its weight times the deviation of what it
        makes of the pixels.

    Returns
    -------
    kept, weights, offset
        The planes' places, ascending, their weights, and the machine's offset.
    """
    kept = np.arange(mapped.shape[1])
    if settings.spare:
        weights, _ = _solve(mapped, road, settings.c)
        moved = np.abs(weights) * mapped.std(axis=0)
        kept = np.sort(np.argsort(-moved, kind="stable")[: settings.planes])
    return kept, *_solve(mapped.take(kept, axis=1), road, settings.c)


def _solve(mapped: Values, road: npt.NDArray[np.bool_], c: float) -> tuple[Floats, float]:
    """Solve the primal of a linear machine with a squared hinge loss, with liblinear."""
    try:
        return _by_liblinear(mapped, road, c)
    except (ImportError, AttributeError, TypeError, ValueError):
        return _by_linear_svc(mapped, road, c)


def _by_liblinear(mapped: Values, road: npt.NDArray[np.bool_], c: float) -> tuple[Floats, float]:
    """Return what `_by_linear_svc` does, bit for bit, by calling liblinear as it does.

    The function is not a public one: see `roadeval.pipeline.paper.svm`, which calls libsvm so.
    """
    liblinear = extension("sklearn.svm._liblinear", *NOT_RUN)
    liblinear.set_verbosity_wrap(0)  # or it prints what it did
    (weights,), (rounds,) = liblinear.train_wrap(
        np.ascontiguousarray(mapped, np.float64),
        road.astype(np.float64),
        False,  # the features are no sparse matrix
        _PRIMAL,
        _TOLERANCE,
        1.0,  # the offset's own feature
        c,
        np.ones(2),
        _ROUNDS,
        0,
        0.1,  # of other losses
        np.ones(len(mapped)),
    )
    if rounds >= _ROUNDS or not np.isfinite(weights).all():
        raise ValueError("no solution that could be kept quiet about")
    return weights[:-1], float(weights[-1])


def _by_linear_svc(mapped: Values, road: npt.NDArray[np.bool_], c: float) -> tuple[Floats, float]:
    # Only here: the import takes a second and 40 MiB.
    machine = whole("sklearn.svm").LinearSVC(C=c, dual=False).fit(mapped, road)
    return machine.coef_[0], float(machine.intercept_[0])


def left_out(mapped: Values, sample: TrainingSet, settings: ContextSettings) -> Values:
    """Return the decision value of each sampled pixel by a machine fitted without its part.

    The frames are cut into ``folds`` parts in their order: neighbouring frames look alike. NaN
    where the others show one class alone, or there are none.
    """
    part = sample.frame * settings.folds // len(sample.images)
    result = np.full(len(mapped), np.nan, np.float32)
    for fold in np.unique(part):
        here = part == fold
        others = sample.road[~here]
        if others.any() and not others.all():
            kept, weights, offset = solve(mapped[~here], others, settings)
            result[here] = mapped[here].take(kept, axis=1) @ weights + offset
    return result


def threshold(values: Values, road: npt.NDArray[np.bool_]) -> float:
    """Return the threshold with the least sum of FNR and FPR on left-out decision ``values``.

    Frames show more non-road than road, and the least ERR would be had a little higher; it is
    the same within its noise once phase 4 has removed the false positives that stand alone, and
    twice as much of the dark road would be missed. NaN are left out; 0 if no class is left.
    """
    known = ~np.isnan(values)
    values, road = values[known], road[known]
    if not road.any() or road.all():
        return 0.0
    order = np.argsort(values, kind="stable")
    cost = np.where(road, 1 / road.sum(), -1 / (~road).sum())[order]
    best = int(np.argmin(np.concatenate([[0.0], cost.cumsum()])))
    ends = np.concatenate([values[order[:1]] - 1, values[order], values[order[-1:]] + 1])
    return float((ends[best] + ends[best + 1]) / 2)


# --- The stage ------------------------------------------------------------------------------------


def check_fit(machine: RectifiedMachine, settings: ContextSettings) -> None:
    """Raise a `MisfitError` if the machine is for other features than the settings'.

    Such a model is damaged, or was trained with other settings.
    """
    given = machine.planes.shape[1]
    wanted = number_of_features(settings.windows, settings.start)
    if given != wanted:
        raise MisfitError(
            f"the model is damaged: its machine of stage context is for {given} features, and "
            f"windows = {list(settings.windows)} and geodesics = "
            f"{str(settings.geodesics).lower()} make {wanted}; train it again"
        )


def decision(planes: Values, machine: RectifiedMachine, smoothing: int) -> Values:
    """Compute the decision value (Eq. 16) of `features`, ``(F, h, w)``; ``(h, w)`` float32."""
    values = KERNELS.rectified_sum(
        planes.reshape(len(planes), -1), machine.planes, machine.bias, machine.weights
    )
    side = (smoothing, smoothing)
    smooth: Values = cv2.blur(values.reshape(planes.shape[1:]) + np.float32(machine.offset), side)
    return smooth


def bind(settings: ContextSettings, machine: RectifiedMachine) -> Callable[[View], Output]:
    """Return the machine as a pure function of what it sees; a `MisfitError`, see `check_fit`."""
    check_fit(machine, settings)

    def run(view: View) -> Output:
        small, shape = reduced(view.image, settings.width), view.image.shape
        seen = features(small, settings.windows, settings.start)
        values = stretched(decision(seen, machine, settings.smoothing), shape)
        road = Packed.of(values > machine.threshold)
        shown = [Layer(DECISION, values), Layer(SVM, road)]
        if settings.geodesics:
            # Of the three the one with most to see: kerbs and verges.
            shown.insert(0, Layer(GEODESIC, stretched(distance_of(seen[1 - GEODESICS]), shape)))
        return Output(tuple(shown), mask=road)

    return run


def layers(settings: ContextSettings) -> tuple[LayerSpec, ...]:
    """Return the layers of the machine."""
    return (GEODESIC, DECISION, SVM) if settings.geodesics else (DECISION, SVM)


STAGE: Final = Stage(
    name="context",
    title="Phase 3: support vector machine on colour, place, column and texture",
    settings=ContextSettings,
    bind=bind,
    layers=layers,
    fit=fit,
    parameters=RectifiedMachine,
    oracle=perfect_mask,
    # Not the threshold: it is learnt, or replaces the one that would have been.
    inference_only=("smoothing",),
    mask=SVM.name,
)
