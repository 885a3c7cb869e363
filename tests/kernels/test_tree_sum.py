"""The sum of decision trees, as a walk from node to node finds it."""

import numpy as np
import pytest

from roadeval.kernels import KERNELS, plain

compiled = pytest.importorskip(
    "roadeval.kernels.compiled", reason="the loops were not compiled", exc_type=ImportError
)
ALL = 0xFFFFFFFF
GREATEST = 1e15
"""Threshold of an unused node: no feature is above it."""


def forest(*trees):
    """Arrays of trees, each by its nodes' ``(feature, threshold, leaves)`` and its leaves' values.

    Nodes and leaves are filled up to 32.
    """
    shape = len(trees), plain.LEAVES
    feature, threshold = np.zeros(shape, np.int32), np.full(shape, GREATEST, np.float32)
    leaves, values = np.full(shape, ALL, np.uint32), np.zeros(shape, np.float32)
    for tree, (nodes, added) in enumerate(trees):
        for place, (which, least, left) in enumerate(nodes):
            feature[tree, place], threshold[tree, place], leaves[tree, place] = which, least, left
        values[tree, : len(added)] = added
    return feature, threshold, leaves, values


# Above 0.5 in feature 0: the third leaf. Else above 2 in feature 1: the second. Else the first.
TREE = [(0, 0.5, ALL & ~0b011), (1, 2.0, ALL & ~0b001)], [10.0, 20.0, 30.0]
STUMP = [(1, 3.0, ALL & ~1)], [1.0, 2.0]


@pytest.mark.parametrize(
    ("trees", "features", "expected"),
    [
        ([TREE], [[0.0, 0.0, 1.0, 1.0], [2.0, 2.5, 0.0, 9.0]], [10, 20, 30, 30]),
        ([TREE], [[0.5], [0.0]], [10]),  # a value at the threshold is not above it
        ([TREE, STUMP], [[0.0, 1.0], [4.0, 0.0]], [20 + 2, 30 + 1]),
    ],
)
def test_a_pixel_gets_the_sum_of_the_leaves_that_walks_end_at(trees, features, expected):
    assert KERNELS.tree_sum(np.array(features, np.float32), *forest(*trees)).tolist() == expected


@pytest.mark.parametrize("pixels", [1, 255, 256, 257, 1000])
def test_the_twins_agree_on_any_number_of_pixels(pixels):
    rng = np.random.default_rng(pixels)
    features = rng.normal(size=(7, pixels)).astype(np.float32)
    feature = rng.integers(0, 7, (9, 32)).astype(np.int32)
    threshold, values = rng.normal(size=(2, 9, 32)).astype(np.float32)
    leaves = (rng.integers(0, 1 << 31, (9, 32)) | 1 << 31).astype(np.uint32)
    arguments = features, feature, threshold, leaves, values
    np.testing.assert_array_equal(compiled.tree_sum(*arguments), plain.tree_sum(*arguments))


def test_arrays_that_do_not_fit_together_are_refused():
    features = np.zeros((2, 4), np.float32)
    feature, threshold, leaves, values = forest(TREE)
    for wrong in [(feature[:, :4], threshold), (feature, threshold[:0])]:
        with pytest.raises(ValueError, match="shape"):
            compiled.tree_sum(features, *map(np.ascontiguousarray, wrong), leaves, values)
