"""A network with one hidden layer as plain arrays, and how it is trained.

It sees each feature as its rank among the training pixels: a distance that grows without bound, or
an odd light, then moves no input further than any other value does. Trees err in steps, along
single features; planes through all of them at once err elsewhere, so that the mean of both errs
less.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.data.arrays import Flags, Floats, Values
from roadeval.pipeline.stage import check_arrays

CODES: Final = 256
"""Equal steps of a feature between its outer percentiles; each has a rank."""
OUTER: Final = 0.5
"""The lower of these percentiles. What is beyond them counts as they do."""
LEAST: Final = 1e-6
"""Between the percentiles of a feature that hardly varies."""
PENALTY: Final = 0.1
"""Of the squared weights (scikit-learn's ``alpha``)."""
PLANES: Final = 64
"""Number of units of the hidden layer. The time of a decision grows with it."""
PASSES: Final = 12
"""Of the training through as many pixels as there are."""
NOISE: Final = 0.1
"""Deviation of what is added in training to each rank, -1 to 1."""
BATCH: Final = 256
"""Pixels between two steps of the training, at most."""
STEPS: Final = 150
"""In a pass, at least, as long as that leaves each `FEWEST` pixels."""
FEWEST: Final = 16
STEP: Final = 0.002
"""Of Adam's steps, at first; they shrink to nothing in equal parts from pass to pass."""

Codes = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class HiddenLayer:
    """Rectified planes through ranks, and their weighted sum."""

    lowest: Values
    """``(F,)`` float32."""
    scale: Values
    """``(F,)`` float32: a feature x has the code ``scale (x - lowest)``, rounded, 0 to 255."""
    ranks: Values
    """``(F, CODES)`` float32: what each code counts for, -1 to 1."""
    planes: Values
    """``(K, F)`` float32."""
    bias: Values
    """``(K,)`` float32."""
    weights: Values
    """``(K,)`` float32."""
    shift: float
    """Where the sum begins."""

    def __post_init__(self) -> None:
        check_arrays(self, np.float32, lowest=("F",), scale=("F",), ranks=("F", CODES), shift=())
        planes = ("K", self.inputs)
        check_arrays(self, np.float32, planes=planes, bias=("K",), weights=("K",))

    @property
    def inputs(self) -> int:
        """How many features of a pixel it sees."""
        return len(self.lowest)

    def sums(self, values: Values) -> Values:
        """Return the log-odds of each pixel of ``(F, n)`` features, ``(n,)`` float32."""
        inner = self.planes @ ranked(values, self.lowest, self.scale, self.ranks)
        inner += self.bias[:, None]
        np.maximum(inner, 0, out=inner)
        return self.weights @ inner + self.shift


def train(values: Values, road: Flags, weights: Floats | None, seed: int) -> HiddenLayer:
    """Train a network with scikit-learn's Adam, by one thread.

    Each pass draws pixels anew by their weights, and adds other noise to their ranks: few frames
    show few values of what is the same all over a frame, and nothing shall hang on their digits.
    The arguments are those of `roadeval.pipeline.beyond.trees.grow`.
    """
    from threadpoolctl import threadpool_limits

    lowest, highest = np.percentile(values, [OUTER, 100 - OUTER], axis=0).astype(np.float32)
    scale = (CODES - 1) / np.maximum(highest - lowest, LEAST)
    features = np.ascontiguousarray(values.T)
    # Of each code the share of pixels below it less that above it.
    counts = [np.bincount(codes, minlength=CODES) for codes in codes_of(features, lowest, scale)]
    shares = [(2 * count.cumsum() - count) / len(road) - 1 for count in counts]
    ranks = np.stack(shares).astype(np.float32)
    seen = np.ascontiguousarray(ranked(features, lowest, scale, ranks).T)
    rng, count = np.random.default_rng(seed), len(road)
    chances = None if weights is None else weights / weights.sum()
    # Only here: the import takes a second, and a model from a file does not need it.
    from sklearn.neural_network import MLPClassifier

    network = MLPClassifier(
        (PLANES,),
        alpha=PENALTY,
        batch_size=min(count, max(FEWEST, min(BATCH, count // STEPS))),
        learning_rate_init=STEP,
        random_state=seed,
    )
    with threadpool_limits(1, "blas"):
        for number in range(PASSES):
            drawn = rng.choice(count, count, p=chances)
            noisy = rng.standard_normal((count, seen.shape[1]), dtype=np.float32)
            noisy *= NOISE
            noisy += seen[drawn]
            if number:
                network._optimizer.learning_rate_init = STEP * (1 - number / PASSES)
            network.partial_fit(noisy, road[drawn], classes=[False, True])
    (inner, out), (bias, shift) = network.coefs_, network.intercepts_
    return HiddenLayer(
        lowest,
        scale,
        ranks,
        np.ascontiguousarray(inner.T, np.float32),
        bias.astype(np.float32),
        np.ascontiguousarray(out[:, 0], np.float32),
        float(shift.item()),
    )


def codes_of(values: Values, lowest: Values, scale: Values) -> Codes:
    """Return the codes of ``(F, n)`` features, see `HiddenLayer`."""
    found = np.empty(values.shape, np.uint8)
    for place, feature, least, step in zip(found, values, lowest, scale, strict=True):
        place[...] = np.clip((feature - least) * step + 0.5, 0, CODES - 1)
    return found


def ranked(values: Values, lowest: Values, scale: Values, ranks: Values) -> Values:
    """Return the ranks of ``(F, n)`` features, ``(F, n)`` float32."""
    codes = codes_of(values, lowest, scale)
    found = np.empty(values.shape, np.float32)
    for place, code, rank in zip(found, codes, ranks, strict=True):
        place[...] = cv2.LUT(code[None], rank[None])[0]
    return found
