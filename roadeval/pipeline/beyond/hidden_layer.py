"""A network with one hidden layer as plain arrays, and how it is trained.

Each feature is replaced by its rank among the training pixels, so that an extreme distance or light
gives no extreme input. Trees split single features, planes combine all of them: their errors
differ, and the mean of both errs less.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
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
"""The lower of these percentiles. Values beyond a percentile count as that percentile."""
LEAST: Final = 1e-6
"""Smallest range between the percentiles, for a feature that hardly varies."""
PENALTY: Final = 0.1
"""Weight of the squared weights in the loss."""
PLANES: Final = 64
"""Number of units of the hidden layer. The time of a decision grows with it."""
PASSES: Final = 12
"""Number of passes; each draws as many pixels as there are."""
NOISE: Final = 0.1
"""Deviation of the noise that training adds to each rank, -1 to 1."""
BATCH: Final = 256
"""Greatest number of pixels in a batch. Each batch makes one step."""
BATCHES: Final = 150
"""Least number of batches in a pass, unless a batch would have fewer than `FEWEST` pixels."""
FEWEST: Final = 16
STEP: Final = 0.002
"""Length of Adam's steps in the first pass; it falls to 0 in equal parts from pass to pass."""
MEAN_DECAY, SQUARE_DECAY, TINY = 0.9, 0.999, 1e-8
"""Adam's constants: decay of the means of gradients and of their squares, and least divisor."""

Codes = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class HiddenLayer:
    """Rectified planes through ranks, and their weighted sum."""

    lowest: Values
    """``(F,)`` float32."""
    scale: Values
    """``(F,)`` float32: a feature x has the code ``scale (x - lowest)``, rounded, 0 to 255."""
    ranks: Values
    """``(F, CODES)`` float32: the rank of each code, -1 to 1."""
    planes: Values
    """``(K, F)`` float32."""
    bias: Values
    """``(K,)`` float32."""
    weights: Values
    """``(K,)`` float32."""
    shift: float
    """Start of the sum."""

    def __post_init__(self) -> None:
        check_arrays(self, np.float32, lowest=("F",), scale=("F",), ranks=("F", CODES), shift=())
        planes = ("K", self.inputs)
        check_arrays(self, np.float32, planes=planes, bias=("K",), weights=("K",))

    @property
    def inputs(self) -> int:
        """Number of features of a pixel."""
        return len(self.lowest)

    def sums(self, values: Values) -> Values:
        """Return the log-odds of each pixel of ``(F, n)`` features, ``(n,)`` float32."""
        inner = self.planes @ rank_features(values, self.lowest, self.scale, self.ranks)
        inner += self.bias[:, None]
        np.maximum(inner, 0, out=inner)
        return self.weights @ inner + self.shift


def train(values: Values, road: Flags, weights: Floats | None, seed: int) -> HiddenLayer:
    """Train a network on one thread.

    Each pass draws pixels anew by their weights, and adds new noise to their ranks: in a few
    frames, a feature that is the same all over a frame has few values, and the network must not
    depend on their exact digits. The arguments are as in `roadeval.pipeline.beyond.trees.grow`.
    """
    from threadpoolctl import threadpool_limits

    lowest, highest = np.percentile(values, [OUTER, 100 - OUTER], axis=0).astype(np.float32)
    scale = (CODES - 1) / np.maximum(highest - lowest, LEAST)
    features = np.ascontiguousarray(values.T)
    # A code's rank is the share of pixels below it less the share above it.
    counts = [np.bincount(codes, minlength=CODES) for codes in codes_of(features, lowest, scale)]
    shares = [(2 * count.cumsum() - count) / len(road) - 1 for count in counts]
    ranks = np.stack(shares).astype(np.float32)
    pixels = np.ascontiguousarray(rank_features(features, lowest, scale, ranks).T)
    rng, count = np.random.default_rng(seed), len(road)
    chances = None if weights is None else weights / weights.sum()

    def passes() -> Iterator[tuple[Values, Flags, float]]:
        """Yield noisy pixels, their labels and the step of each pass."""
        for number in range(PASSES):
            drawn = rng.choice(count, count, p=chances)
            noisy = rng.standard_normal((count, pixels.shape[1]), dtype=np.float32)
            noisy *= NOISE
            noisy += pixels[drawn]
            yield noisy, road[drawn], STEP * (1 - number / PASSES)

    batch = min(count, max(FEWEST, min(BATCH, count // BATCHES)))
    with threadpool_limits(1, "blas"):
        inner, out, bias, shift = descend(passes(), pixels.shape[1], PLANES, batch, seed)
    planes, weighted = np.ascontiguousarray(inner.T), np.ascontiguousarray(out[:, 0])
    return HiddenLayer(lowest, scale, ranks, planes, bias, weighted, float(shift[0]))


def descend(
    passes: Iterable[tuple[Values, Flags, float]], inputs: int, units: int, batch: int, seed: int
) -> list[Values]:
    """Train a network by Adam (Kingma and Ba, ICLR 2015), bit for bit as scikit-learn does.

    scikit-learn's ``MLPClassifier`` takes twice as long, and its steps have one length. A pass is
    ``(n, inputs)`` float32 pixels, their labels, and the length of a step, for which ``batch``
    pixels are taken. ``seed`` decides the first weights, and the order of pixels in a pass.
    Returned are the weights of the hidden layer ``(inputs, units)`` and of the output
    ``(units, 1)``, then the biases of both, float32.
    """
    from scipy.special import expit

    random = np.random.RandomState(seed)
    weights: list[Values] = []
    biases: list[Values] = []
    for size, width in ((inputs, units), (units, 1)):
        bound = np.sqrt(6 / (size + width))
        weights.append(random.uniform(-bound, bound, (size, width)).astype(np.float32))
        biases.append(random.uniform(-bound, bound, width).astype(np.float32))
    layers = inner, out, bias, shift = [*weights, *biases]
    means, squares = ([np.zeros_like(layer) for layer in layers] for _ in range(2))
    time = 0
    for pixels, road, length in passes:
        order = np.arange(len(pixels))
        random.shuffle(order)
        random = np.random.RandomState(seed)
        for start in range(0, len(order), batch):
            drawn = order[start : start + batch]
            values, count = pixels[drawn], len(drawn)
            hidden = np.maximum(values @ inner + bias, 0)
            error = expit(hidden @ out + shift) - road[drawn, None]
            back = (error @ out.T) * (hidden != 0)
            slopes = (
                (values.T @ back + PENALTY * inner) / count,
                (hidden.T @ error + PENALTY * out) / count,
                back.sum(axis=0) / count,
                error.sum(axis=0) / count,
            )
            time += 1
            step = length * np.sqrt(1 - SQUARE_DECAY**time) / (1 - MEAN_DECAY**time)
            for layer, mean, square, slope in zip(layers, means, squares, slopes, strict=True):
                mean[...] = MEAN_DECAY * mean + (1 - MEAN_DECAY) * slope
                square[...] = SQUARE_DECAY * square + (1 - SQUARE_DECAY) * slope**2
                layer[...] -= step * mean / (np.sqrt(square) + TINY)
    return layers


def codes_of(values: Values, lowest: Values, scale: Values) -> Codes:
    """Return the codes of ``(F, n)`` features, see `HiddenLayer`."""
    codes = np.empty(values.shape, np.uint8)
    for row, feature, least, step in zip(codes, values, lowest, scale, strict=True):
        row[...] = np.clip((feature - least) * step + 0.5, 0, CODES - 1)
    return codes


def rank_features(values: Values, lowest: Values, scale: Values, ranks: Values) -> Values:
    """Return the ranks of ``(F, n)`` features, ``(F, n)`` float32."""
    codes = codes_of(values, lowest, scale)
    ranked = np.empty(values.shape, np.float32)
    for row, code, rank in zip(ranked, codes, ranks, strict=True):
        row[...] = cv2.LUT(code[None], rank[None])[0]
    return ranked
