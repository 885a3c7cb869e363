"""A shadow filter with a learnt gate: dark road becomes as bright as the lit road of its frame.

The paper's filter (`shadow`) takes every pixel with a high NDI for shadow. This one estimates the
probability that a dark pixel is road in the shade, and brightens the pixel in proportion: it has no
regions and no hard threshold. If the training frames show no road in the shade, nothing is learnt,
and every frame stays unchanged, bit for bit.

A shadow, a dark car and a hedge may have the same colour. The filter learns to tell them apart, as
the shadow detector of Guo, Dai and Hoiem does [1]_, but by pixel: a logistic regression on the
surroundings of a dark pixel, on its place, and on the ground between it and the vehicle. All
brightness is relative to the frame's own sunlit road, so that it holds for any exposure. The stages
after it see only colours and need the same light in each frame: the stage `exposure` comes before
it in the preset.

References
----------
.. [1] R. Guo, Q. Dai, D. Hoiem, Single-Image Shadow Detection and Removal using Paired Regions,
   CVPR 2011.
.. [2] A. Rahimi, B. Recht, Weighted Sums of Random Kitchen Sinks: Replacing Minimization with
   Randomization in Learning, NIPS 2008.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Final

import cv2
import numpy as np
from pydantic import Field

from roadeval.data import Layer, LayerKind, LayerSpec, Packed, Rgb, Truth, colours, mask_spec
from roadeval.data.arrays import Flags, Floats, Values
from roadeval.pipeline import stage
from roadeval.pipeline.beyond.features import paths
from roadeval.pipeline.paper.shadow import SHADOW_COLOUR
from roadeval.pipeline.reference_patch import ReferencePatch
from roadeval.pipeline.scene import Scene, enlarge, mean, reduce_to, stretch
from roadeval.pipeline.stage import Output, Stage, TrainingSet, View

GRID: Final = (12, 16)
"""Rows and columns of the cells by which the place of road is learnt."""
WIDTH: Final = 160
"""Columns of the working image, to which wider images are reduced for all decisions. Texture then
means the same for every camera, and the time is the same too."""
DARKNESS: Final = 0.6
"""Candidates are darker than this share of the sunlit level."""
PLACE: Final = 0.05
"""Candidates lie where more than this share of the training pixels is road: sky, trees and houses
are elsewhere."""
DOUBT: Final = 0.1
"""Below this probability no pixel is brightened."""
WINDOWS: Final = (3, 9)
"""Sides of the squares over which texture is averaged."""
PATCH: Final = ReferencePatch()
FEATURES: Final = 13 + 2 * len(WINDOWS)
"""Number of features of a pixel, see `features_of`."""
STEPS: Final = 0.05
"""Added to a geodesic distance before the logarithm: ten steps on smooth ground."""
LEVEL: Final = 0.85
"""The frame's sunlit level is this quantile of brightness among pixels that are probably road."""
LIT: Final = 0.7
"""Lit road is brighter than this share of the sunlit level."""
OFFSET: Final = 8.0
"""Added to a channel before ratios are taken, as in `LOGS`."""
LEAST: Final = 30
"""Least number of sampled candidates of either class to learn from."""
NOTHING: Final = -20.0
"""The log-odds of every candidate if there were too few to learn from."""
PLANES: Final = 128
"""Planes of the feature map on which the odds are learnt. The time of a frame grows with them."""
PENALTY: Final = 0.01
"""Penalty of the squared weights per training pixel."""
GREATEST_GAIN: Final = 8.0
"""Greatest gain of a channel."""
SOFTNESS: Final = 3
"""Side of the square that the gains are averaged over, so that edges stay soft."""
_ROUNDS: Final = 25
EDGE: Final = 2
"""Pixels of the working image beside the shadow that are neither it nor lit."""


def _map(name: str, title: str, span: tuple[float, float]) -> LayerSpec:
    return LayerSpec(name, LayerKind.SCALAR, title, value_range=span, exact=False)


CANDIDATES: Final = mask_spec(
    "candidates", "Dark, where road may be", none=colours.CLEAR, candidate=SHADOW_COLOUR
)
SHADED: Final = _map("shaded", "How likely it is road in the shade", (0.0, 1.0))
SHADOW: Final = mask_spec(
    "shadow", "More likely road in the shade than not", none=colours.CLEAR, shadow=SHADOW_COLOUR
)
GAIN: Final = _map("gain", "Greatest gain of a channel", (1.0, GREATEST_GAIN))
COMPENSATED: Final = LayerSpec("compensated", LayerKind.RGB, "Compensated image", exact=False)


@stage.stage_settings
class GatedSettings:
    """Settings of the gated filter.

    odds: Factor of the odds that a candidate is shaded road. A greater one brightens more dark
        road, but also more pixels that are not road. A classifier on colours calls these road, and
        needs a small factor; one that also sees place and surroundings works with 1.
    """

    odds: Annotated[float, Field(gt=0, le=1e6)] = 0.1


@dataclass(frozen=True, eq=False)
class GatedView:
    """A working image with its light and its candidates."""

    image: Rgb
    """``(h, w, 3)`` uint8 RGB."""
    level: float
    """Sunlit level of ``R + G + B``."""
    lit: Floats
    """``(3,)``: mean colour of lit road."""
    place: Values
    """``(h, w)`` float32: the road's share by place."""
    candidates: Flags
    """``(h, w)`` bool."""


def look(image: Rgb, place: Floats) -> GatedView:
    """Find the sunlit level, lit road's colour and the candidates of a working image.

    Nearly every frame has some lit road among the pixels that are probably road by their place. The
    level of these is within a tenth of the true one; by the colour of road it is within a third.
    """
    height, width = image.shape[:2]
    total = sum(cv2.split(image.astype(np.uint16)))
    share = cv2.resize(place.astype(np.float32), (width, height))
    likely = share > 0.5
    counted = np.cumsum(np.bincount(total[likely], share[likely], minlength=1))
    level = float(np.searchsorted(counted, LEVEL * counted[-1])) if counted[-1] > 0 else 0.0
    lit = np.array(cv2.mean(image, (likely & (total >= LIT * level)).view(np.uint8))[:3])
    candidates = (total < DARKNESS * level) & (share > PLACE)
    return GatedView(image, level, lit, share, candidates)


def features_of(seen: GatedView) -> Values:
    """Compute the features of every pixel, ``(F, h, w)`` float32.

    These are log brightness and two log-chromaticities relative to those of lit road; the two
    unchanged; the distance from the middle column, and the row; the steepest edge across the column
    below and the darkest pixel in it, relative to the sunlit level; texture, for each window the
    root of the mean absolute slope across and down; the logarithms of the geodesic distances from
    the reference patch (`features.paths`); and the road's share by place.
    """
    scene = Scene.of(seen.image, seen.image, PATCH)
    light, red, blue = scene.tones
    top = np.float32(np.log(seen.level / 3 + OFFSET))
    lit = np.log(seen.lit + OFFSET).astype(np.float32)
    down, across = np.mgrid[: scene.shape[0], : scene.shape[1]].astype(np.float32) + 0.5
    slopes = [np.abs(slope) for slope in scene.slopes]
    edge, dark = np.sqrt(cv2.blur(slopes[1], (5, 3))), mean(light, 5) - top
    return np.stack(
        [
            light - top,
            red - (lit[0] - lit[1]),
            blue - (lit[2] - lit[1]),
            red,
            blue,
            np.abs(across * (2 / scene.shape[1]) - 1),
            down / scene.shape[0],
            np.maximum.accumulate(edge[::-1])[::-1],
            np.minimum.accumulate(dark[::-1])[::-1],
            *(np.sqrt(mean(slope, side)) for side in WINDOWS for slope in slopes),
            *(np.log(far + STEPS) for far in paths(scene).values()),
            seen.place,
        ]
    )


@dataclass(frozen=True, eq=False)
class ShadedRoad:
    """Learnt parameters of the gated filter: where road is, and the odds of road in the shade."""

    place: Floats
    """``GRID`` float64: for each cell of the image the share of training pixels that are road."""
    planes: Values
    """``(K, F)`` float32."""
    bias: Values
    """``(K,)`` float32."""
    weights: Values
    """``(K,)`` float32."""
    offset: float
    """The log-odds are ``sum_k weights[k] max(planes[k] . x + bias[k], 0) + offset``."""

    def __post_init__(self) -> None:
        stage.check_arrays(self, np.float64, place=GRID)
        stage.check_range("place", self.place, 0, 1)
        shapes = {"planes": ("K", FEATURES), "bias": ("K",), "weights": ("K",), "offset": ()}
        stage.check_arrays(self, np.float32, **shapes)


def fit(sample: TrainingSet, _settings: GatedSettings) -> ShadedRoad:
    """Learn where road is, and the odds that a dark pixel is road."""
    place = learn_place(sample)
    values, labels = [], []
    for index, image in enumerate(sample.images):
        here = sample.frame == index
        seen = look(reduce_to(image, WIDTH), place)
        rows, columns = seen.candidates.shape
        row = sample.row[here] * rows // image.shape[0]
        column = sample.column[here] * columns // image.shape[1]
        dark = seen.candidates[row, column]
        values.append(features_of(seen)[:, row[dark], column[dark]].T)
        labels.append(sample.road[here][dark])
    features, road = np.concatenate(values), np.concatenate(labels)
    if min(road.sum(), (~road).sum()) < LEAST:
        none = np.zeros((1, FEATURES), np.float32)
        return ShadedRoad(place, none, none[:, 0], none[:, 0], NOTHING)
    planes, bias = draw_planes(features, PLANES, sample.seed)
    mapped = np.maximum(features @ planes.T + bias, 0).astype(np.float64)
    weights, offset = logistic(mapped, road, PENALTY)
    return ShadedRoad(place, planes, bias, weights.astype(np.float32), offset)


def learn_place(sample: TrainingSet) -> Floats:
    """Return the share of training pixels in each cell that are road; the halves are symmetric.

    One more pixel of either class keeps cells with few pixels undecided.
    """
    height, width = np.array([image.shape[:2] for image in sample.images]).T
    row = sample.row * GRID[0] // height[sample.frame]
    column = sample.column * GRID[1] // width[sample.frame]
    counts = np.ones((2, *GRID))
    for across in (column, GRID[1] - 1 - column):
        np.add.at(counts, (sample.road.astype(np.intp), row, across), 1)
    return counts[1] / counts.sum(axis=0)


def draw_planes(values: Values, count: int, seed: int) -> tuple[Values, Values]:
    """Draw planes ``(count, F)`` and their bias ``(count,)`` for ``(n, F)`` features.

    Directions are uniform on the sphere of standardised features; each plane goes through one of
    the pixels, and is scaled so that its largest value there is 1 [2]_.
    """
    rng = np.random.default_rng(seed)
    deviation = values.std(axis=0)
    planes = rng.normal(size=(count, values.shape[1]))
    planes /= np.linalg.norm(planes, axis=1, keepdims=True) * np.where(deviation > 0, deviation, 1)
    bias = -(planes * values[rng.integers(0, len(values), count)]).sum(axis=1)
    largest = np.maximum((values @ planes.T + bias).max(axis=0), 1e-6)
    return (planes / largest[:, None]).astype(np.float32), (bias / largest).astype(np.float32)


def logistic(mapped: Floats, road: Flags, penalty: float) -> tuple[Floats, float]:
    """Fit a logistic regression with an L2 penalty, by Newton's method.

    scikit-learn's gives the same weights, and its import alone takes a second. The weights w of
    standardised columns z and the offset b minimise the mean of ``ln(1 + exp(-s (w . z + b)))``, s
    being 1 for road and -1 for the rest, plus ``penalty / 2 |w|^2``. ``mapped`` is ``(n, K)``;
    ``road`` is ``(n,)``, and both classes occur; ``penalty`` is above 0. Returned are the weights
    of the unscaled columns, ``(K,)`` float64, and the offset.
    """
    mean, deviation = mapped.mean(axis=0), np.maximum(mapped.std(axis=0), 1e-6)
    columns = np.column_stack([(mapped - mean) / deviation, np.ones(len(mapped))])
    ridge = np.append(np.full(len(mean), penalty), 1e-6)
    weights = np.zeros(len(ridge))
    for _ in range(_ROUNDS):
        share = _sigmoid(columns @ weights)
        slope = columns.T @ (share - road) / len(road) + ridge * weights
        bend = (columns * np.maximum(share * (1 - share), 1e-6)[:, None]).T @ columns / len(road)
        step = np.linalg.solve(bend + np.diag(ridge), slope)
        weights -= step
        if np.abs(step).max() < 1e-6:
            break
    unscaled = weights[:-1] / deviation
    return unscaled, float(weights[-1] - mean @ unscaled)


def probability(seen: GatedView, model: ShadedRoad, odds: float) -> Values:
    """Return the probability of every pixel to be road in the shade, ``(h, w)`` float32.

    It is 0 except at candidates.
    """
    result: Values = np.zeros(seen.candidates.shape, np.float32)
    if seen.candidates.any():
        values = features_of(seen)[:, seen.candidates].T
        sums = np.maximum(values @ model.planes.T + model.bias, 0) @ model.weights
        result[seen.candidates] = _sigmoid(sums + np.float32(model.offset + np.log(odds)))
    return result


def _sigmoid(values: Any) -> Any:
    return 1 / (1 + np.exp(-np.clip(values, -30, 30)))


def gains(seen: GatedView, shaded: Values) -> Values:
    """Return the gain of each channel at each pixel, ``(h, w, 3)`` float32; 1 changes nothing.

    It is ``(L / S)^p``: L is the mean colour of lit road, S the colour of the pixel, and p the
    probability that it is road in the shade, 0 except at candidates. For such road, L / S is the
    ratio of illumination. Each gain lies in 1..`GREATEST_GAIN`; then gains are averaged over a
    square.
    """
    lit = np.log((seen.lit + OFFSET).astype(np.float32))
    dark = np.log(seen.image.astype(np.float32) + OFFSET)
    ratio = np.clip(lit - dark, 0, math.log(GREATEST_GAIN))
    return cv2.blur(np.exp(ratio * shaded[..., None]), (SOFTNESS, SOFTNESS))


def brighten(image: Rgb, gain: Values) -> Rgb:
    """Return ``(I + 8) g - 8`` of ``(H, W, 3)`` uint8 RGB; rounded and clipped.

    The gains ``(h, w, 3)`` float32, none below 1, multiply colours with `OFFSET` added, so that
    noise in the dark grows less.
    """
    bright = image.copy()
    if len(touched := np.flatnonzero((gain > 1).any(axis=(1, 2)))):
        scale = len(image) / len(gain)
        # Interpolation reaches no further than to the next row.
        first, end = int((touched[0] - 1) * scale), math.ceil((touched[-1] + 2) * scale)
        rows = slice(max(first, 0), end)
        here = stretch(gain, image.shape)[rows]
        result = cv2.multiply(image[rows], here, dtype=cv2.CV_32F)
        cv2.scaleAdd(here, OFFSET, result, dst=result)
        cv2.convertScaleAbs(result, dst=bright[rows], beta=-OFFSET)
    return bright


@stage.per_view
def bind(settings: GatedSettings, model: ShadedRoad, view: View) -> Output:
    """Filter the image of a view."""
    shape = view.image.shape
    seen = look(reduce_to(view.image, WIDTH), model.place)
    likely = probability(seen, model, settings.odds)
    shaded = np.maximum((likely - DOUBT) / (1 - DOUBT), 0)
    gain = gains(seen, shaded)
    image = brighten(view.image, gain) if shaded.any() else view.image
    small = (shaded > 0.5).view(np.uint8)
    edge = cv2.dilate(small, np.ones((2 * EDGE + 1, 2 * EDGE + 1), np.uint8)) - small
    masks = {"shadow": small, "shadow_edge": edge, "lit": 1 - (small | edge)}
    regions = {name: Packed.of(enlarge(mask, shape)) for name, mask in masks.items()}
    return Output(
        layers=(
            Layer(CANDIDATES, enlarge(seen.candidates.view(np.uint8), shape)),
            Layer(SHADED, stretch(shaded, shape)),
            Layer(SHADOW, regions["shadow"]),
            Layer(GAIN, stretch(np.maximum.reduce(cv2.split(gain)), shape)),
            Layer(COMPENSATED, image),
        ),
        image=image,
        regions=regions,
    )


def oracle(_settings: GatedSettings, model: ShadedRoad, view: View, truth: Truth) -> Output:
    """Brighten the true shadow."""
    small = reduce_to(view.image, WIDTH)
    shadow = enlarge((truth == 1).view(np.uint8), small.shape)
    gain = gains(look(small, model.place), shadow.astype(np.float32))
    return Output(image=brighten(view.image, gain) if shadow.any() else view.image)


STAGE: Final = Stage(
    name="gated",
    title="Phase 2: gated shadow filter",
    settings=GatedSettings,
    bind=bind,
    layers=(CANDIDATES, SHADED, SHADOW, GAIN, COMPENSATED),
    fit=fit,
    parameters=ShadedRoad,
    is_filter=True,
    oracle=oracle,
)
