"""Decision trees as plain arrays, and how they are grown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from roadeval.data.arrays import Flags, Floats, Indices, Masks, Values
from roadeval.kernels import KERNELS
from roadeval.kernels.plain import LEAVES
from roadeval.pipeline.parameters import GREATEST, check_arrays, check_range
from roadeval.runtime.imports import whole

NODES: Final = LEAVES
"""Places for the nodes of a tree, which uses ``LEAVES - 1`` at most. Nothing exceeds the threshold
of the others."""
ALL: Final = (1 << LEAVES) - 1
"""The bits of all leaves."""
BINS: Final = 255
"""Ranges of a feature that a tree can tell apart: the most that scikit-learn knows."""


class Growth(NamedTuple):
    """How trees are grown."""

    trees: int
    leaves: int
    """Of a tree, at most."""
    rate: float
    """Share of what is left to mend that a tree mends."""
    least: int
    """Training pixels of a leaf, at least."""
    share: float
    """Of the features, drawn anew for each node, among which it chooses."""


@dataclass(frozen=True, slots=True, eq=False)
class Forest:
    """The sum of T trees, see `roadeval.kernels.plain.tree_sum`."""

    feature: Indices
    """``(T, NODES)`` int32: which feature a node looks at."""
    threshold: Values
    """``(T, NODES)`` float32: what the node compares it with."""
    kept: Masks
    """``(T, NODES)`` uint32: a bit for each leaf that is left where the feature is above that."""
    values: Values
    """``(T, LEAVES)`` float32: what each leaf adds."""
    offset: float
    """Where the sum begins."""
    inputs: int
    """How many features of a pixel there were to choose from."""

    def __post_init__(self) -> None:
        check_arrays(self, np.int32, feature=("T", NODES))
        check_arrays(self, np.uint32, kept=(len(self.feature), NODES))
        check_arrays(self, np.float32, threshold=(len(self.feature), NODES))
        check_arrays(self, np.float32, values=(len(self.feature), LEAVES), offset=())
        check_arrays(self, np.float32, inputs=())
        if not isinstance(self.inputs, int):
            raise ValueError("inputs is no whole number")
        check_range("offset", self.offset, -GREATEST, GREATEST)
        check_range("inputs", self.inputs, 1, GREATEST)
        check_range("feature", self.feature, 0, self.inputs - 1)
        if not (self.kept >> np.uint32(LEAVES - 1)).all():
            raise ValueError("kept rules out a tree's last leaf, and so may leave none")

    def sums(self, values: Values) -> Values:
        """Return the sum for each pixel of ``(inputs, n)`` features, ``(n,)`` float32."""
        total: Values = KERNELS.tree_sum(
            values, self.feature, self.threshold, self.kept, self.values
        )
        return total + np.float32(self.offset)


def grow(values: Values, road: Flags, weights: Floats | None, growth: Growth, seed: int) -> Forest:
    """Grow trees with scikit-learn's gradient boosting on histograms [1]_.

    By one thread: sums of many threads end with other last digits from one run to the next.

    Parameters
    ----------
    values
        ``(n, F)`` features, finite.
    road
        ``(n,)`` labels; both occur.
    weights
        ``(n,)`` of the pixels, above 0; None: all weigh the same.
    growth, seed
        How they are grown; of the draw of features.

    References
    ----------
    .. [1] J. H. Friedman, Greedy Function Approximation: A Gradient Boosting Machine, The Annals of
       Statistics 29 (2001).
    """
    from threadpoolctl import threadpool_limits

    # scikit-learn's own way to weighted quantiles takes several times as long as all trees.
    pixel_weights = np.ones(len(values)) if weights is None else weights
    edges = [bin_edges(feature, pixel_weights) for feature in values.T]
    bins = np.column_stack(
        [
            np.searchsorted(own, feature).astype(np.uint8)
            for own, feature in zip(edges, values.T, strict=True)
        ]
    )
    # Only here: the import takes a second, and a model from a file does not need it.
    boosting = whole("sklearn.ensemble").HistGradientBoostingClassifier(
        learning_rate=growth.rate,
        max_iter=growth.trees,
        max_leaf_nodes=growth.leaves,
        min_samples_leaf=growth.least,
        max_features=growth.share,
        early_stopping=False,
        random_state=seed,
    )
    with threadpool_limits(1, "openmp"):
        boosting.fit(bins, road, sample_weight=weights)
    grown = [_arrays(tree.nodes, edges) for (tree,) in boosting._predictors]
    feature, threshold, kept, leaves = (np.stack(each) for each in zip(*grown, strict=True))
    offset = float(boosting._baseline_prediction.item())
    return Forest(feature, threshold, kept, leaves, offset, values.shape[1])


def bin_edges(feature: Values, weights: Floats) -> Values:
    """Return the values that part a feature into bins, ascending, at most ``BINS - 1``.

    Bin i holds what is above edge i - 1, and at most edge i: a value alone where there are few of
    them, else values of equal weight together, up to a weighted quantile (averaged inverted CDF).
    ``feature`` and ``weights`` (above 0) are ``(n,)``; the edges ``(e,)`` float32, none where all
    values are equal.
    """
    order = np.argsort(feature)
    ascending: Values = feature[order]
    distinct: Values = np.unique(ascending)
    if len(distinct) <= BINS:
        below, above = distinct[:-1], distinct[1:]
    else:
        sums = np.cumsum(weights[order])
        wanted = sums[-1] * np.arange(1, BINS) / BINS
        below, above = (
            ascending[np.searchsorted(sums, wanted, side)] for side in ("left", "right")
        )
    middle = ((below.astype(np.float64) + above) / 2).astype(np.float32)
    # Between two neighbours there is no number: the lower one parts them.
    edges: Values = np.unique(np.where(middle < above, middle, below))
    return edges


def _arrays(
    nodes: npt.NDArray[Any], edges: Sequence[Values]
) -> tuple[Indices, Values, Masks, Values]:
    """Return a tree on bins as a row of each of a forest's arrays; its root comes first."""
    feature, threshold = np.zeros(NODES, np.int32), np.full(NODES, GREATEST, np.float32)
    kept, values = np.full(NODES, ALL, np.uint32), np.zeros(LEAVES, np.float32)
    leaves = {int(place): leaf for leaf, place in enumerate(_leaves(nodes, 0))}
    values[: len(leaves)] = nodes["value"][list(leaves)]
    inner = np.flatnonzero(nodes["is_leaf"] == 0)
    feature[: len(inner)] = nodes["feature_idx"][inner]
    # A node's threshold, rounded down, is the last bin that goes left: its edge is the feature's.
    threshold[: len(inner)] = [
        edges[node["feature_idx"]][int(node["num_threshold"])] for node in nodes[inner]
    ]
    for place, node in enumerate(inner):
        ruled_out = sum(1 << leaves[leaf] for leaf in _leaves(nodes, int(nodes["left"][node])))
        kept[place] = ALL & ~ruled_out
    return feature, threshold, kept, values


def _leaves(nodes: npt.NDArray[Any], root: int) -> Iterator[int]:
    """Yield the places of a subtree's leaves, from the left."""
    if nodes["is_leaf"][root]:
        yield root
        return
    for side in ("left", "right"):
        yield from _leaves(nodes, int(nodes[side][root]))
