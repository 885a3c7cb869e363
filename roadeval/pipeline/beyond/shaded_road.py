"""Which dark pixels are road in the shade: candidates of a frame, and odds learnt from the truth.

A shadow, a dark car and a hedge may have one colour. What tells them apart is learnt, as Guo, Dai
and Hoiem learn their shadow detector [1]_, but by pixel: a logistic regression on what surrounds a
candidate, on its place, and on what lies between it and the vehicle. It is asked about dark pixels
alone (`shade_candidates`).

References
----------
.. [1] R. Guo, Q. Dai, D. Hoiem, Single-Image Shadow Detection and Removal using Paired Regions,
   CVPR 2011.
.. [2] A. Rahimi, B. Recht, Weighted Sums of Random Kitchen Sinks: Replacing Minimization with
   Randomization in Learning, NIPS 2008.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data.arrays import Floats, Values
from roadeval.pipeline.beyond.shade_candidates import (
    FEATURES,
    GRID,
    OFFSET,
    GatedSettings,
    Look,
    features_of,
    look,
)
from roadeval.pipeline.beyond.working_image import reduced
from roadeval.pipeline.parameters import GREATEST, check_arrays, check_range
from roadeval.pipeline.stage import TrainingSet

LEAST: Final = 30
"""Candidates of either kind, of those sampled, that there must be to learn from."""
NOTHING: Final = -20.0
"""The log-odds of every candidate where there was too little to learn from."""
_ROUNDS: Final = 25


@dataclass(frozen=True, slots=True, eq=False)
class ShadedRoad:
    """Learnt parameters of the gated filter: where road is, and the odds of road in the shade.

    Parameters
    ----------
    place
        ``GRID`` float64: by cell of the image, the share of the training pixels that is road.
    planes, bias, weights, offset
        The log-odds are ``sum_k weights[k] max(planes[k] . x + bias[k], 0) + offset``; ``(K, F)``,
        ``(K,)`` and ``(K,)`` float32.
    """

    place: Floats
    planes: Values
    bias: Values
    weights: Values
    offset: float

    def __post_init__(self) -> None:
        check_arrays(self, np.float64, place=GRID)
        check_range("place", self.place, 0, 1)
        check_arrays(self, np.float32, planes=("K", FEATURES), bias=("K",), weights=("K",))
        check_arrays(self, np.float32, offset=())
        check_range("offset", self.offset, -GREATEST, GREATEST)


# --- Learning -------------------------------------------------------------------------------------


def fit(sample: TrainingSet, settings: GatedSettings) -> ShadedRoad:
    """Learn where road is, and the odds that a dark pixel is road."""
    place = learn_place(sample)
    values, road = at_candidates(sample, place, settings)
    if min(road.sum(), (~road).sum()) < LEAST:
        none = np.zeros((1, FEATURES), np.float32)
        return ShadedRoad(place, none, none[:, 0], none[:, 0], NOTHING)
    planes, bias = draw_planes(values, settings.planes, sample.seed)
    mapped = np.maximum(values @ planes.T + bias, 0).astype(np.float64)
    weights, offset = logistic(mapped, road, settings.penalty)
    return ShadedRoad(place, planes, bias, weights.astype(np.float32), offset)


def learn_place(sample: TrainingSet) -> Floats:
    """Return the share of the training pixels in each cell that is road, both halves alike.

    One pixel of either class more keeps a cell that was hardly seen undecided.
    """
    height, width = np.array([image.shape[:2] for image in sample.images]).T
    row = sample.row * GRID[0] // height[sample.frame]
    column = sample.column * GRID[1] // width[sample.frame]
    counts = np.ones((2, *GRID))
    for across in (column, GRID[1] - 1 - column):
        np.add.at(counts, (sample.road.astype(np.intp), row, across), 1)
    share: Floats = counts[1] / counts.sum(axis=0)
    return share


def at_candidates(
    sample: TrainingSet, place: Floats, settings: GatedSettings
) -> tuple[Values, npt.NDArray[np.bool_]]:
    """Return the features ``(n, F)`` and labels ``(n,)`` of the sampled pixels that are dark."""
    values, road = [], []
    for index, image in enumerate(sample.images):
        here = sample.frame == index
        seen = look(reduced(image, settings.width), place, settings)
        rows, columns = seen.candidates.shape
        row = sample.row[here] * rows // image.shape[0]
        column = sample.column[here] * columns // image.shape[1]
        dark = seen.candidates[row, column]
        values.append(features_of(seen)[:, row[dark], column[dark]].T)
        road.append(sample.road[here][dark])
    return np.concatenate(values), np.concatenate(road)


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


def logistic(mapped: Floats, road: npt.NDArray[np.bool_], penalty: float) -> tuple[Floats, float]:
    """Fit a logistic regression with an L2 penalty, by Newton's method.

    scikit-learn's gives the same weights, and its import alone takes a second.

    The weights w of standardised columns z and the offset b minimise the mean of
    ``ln(1 + exp(-s (w . z + b)))``, s being 1 for road and -1 for the rest, plus
    ``penalty / 2 |w|^2``; returned are those of the columns as they are.

    Parameters
    ----------
    mapped
        ``(n, K)``.
    road
        ``(n,)``: both classes occur.
    penalty
        Above 0.

    Returns
    -------
    weights, offset
        ``(K,)`` float64, and a number.
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
    own = weights[:-1] / deviation
    return own, float(weights[-1] - mean @ own)


def probability(seen: Look, model: ShadedRoad, odds: float) -> Values:
    """Return the probability of every pixel to be road in the shade, ``(h, w)`` float32.

    0 where there is no candidate.
    """
    result: Values = np.zeros(seen.candidates.shape, np.float32)
    if seen.candidates.any():
        values = features_of(seen)[:, seen.candidates].T
        sums = np.maximum(values @ model.planes.T + model.bias, 0) @ model.weights
        result[seen.candidates] = _sigmoid(sums + np.float32(model.offset + np.log(odds)))
    return result


def _sigmoid(values: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    share: npt.NDArray[np.floating] = 1 / (1 + np.exp(-np.clip(values, -30, 30)))
    return share


# --- Gains ----------------------------------------------------------------------------------------


def gains(seen: Look, shaded: Values, settings: GatedSettings) -> Values:
    """Return the gain of each channel at each pixel, ``(h, w, 3)`` float32; 1 is no change.

    It is ``(L / S)^p``: L is the mean colour of lit road, S that of the candidates around the
    pixel, and p the probability that it is road in the shade. L / S is the ratio of illumination
    if it is. No gain is less than 1 or more than ``greatest``; averaged over a square in the end.
    """
    dark = seen.candidates.astype(np.float32)
    side = (settings.window, settings.window)
    around = cv2.blur(seen.image.astype(np.float32) * dark[..., None], side)
    own = around / np.maximum(cv2.blur(dark, side), 1e-6)[..., None]
    ratio = np.log((seen.lit + OFFSET).astype(np.float32)) - np.log(own + OFFSET)
    np.clip(ratio, 0, np.log(settings.greatest), out=ratio)
    soft: Values = cv2.blur(
        np.exp(ratio * shaded[..., None]), (settings.softness, settings.softness)
    )
    return soft


def shade_of(seen: Look, model: ShadedRoad, settings: GatedSettings) -> Values:
    """Return how far each pixel is brightened, 0 to 1, ``(h, w)`` float32."""
    found = probability(seen, model, settings.odds)
    found -= np.float32(settings.least)
    found /= np.float32(1 - settings.least)
    return np.maximum(found, 0, out=found)
