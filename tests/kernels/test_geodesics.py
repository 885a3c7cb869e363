"""Geodesic distances: the length of the cheapest path, as Dijkstra finds it.

`tests/pipeline/beyond/test_features.py` holds them against scikit-image's.
"""

import heapq

import numpy as np
import pytest

from roadeval.kernels import KERNELS, plain

AMPLE = 50
"""Rounds after which nothing changes on these images."""


def seeds_of(shape, *places):
    seeds = np.zeros(shape, np.uint8)
    seeds[tuple(zip(*places, strict=True))] = 1
    return seeds


def dijkstra(cost, seeds):
    """Cheapest paths, pixel by pixel; ``cost`` is int64."""
    lengths = np.full(cost.shape, plain.FAR)
    queue = [(0, int(y), int(x)) for y, x in np.argwhere(seeds)]
    while queue:
        length, y, x = heapq.heappop(queue)
        if length >= lengths[y, x]:
            continue
        lengths[y, x] = length
        for dy, dx in np.argwhere(np.ones((3, 3))) - 1:
            to = y + dy, x + dx
            if (dy or dx) and 0 <= to[0] < cost.shape[0] and 0 <= to[1] < cost.shape[1]:
                step = plain.ASLANT if dy and dx else plain.STRAIGHT
                heapq.heappush(queue, (length + step * int(cost[y, x] + cost[to]), *to))
    return lengths


def test_without_seeds_everything_is_far():
    far = KERNELS.geodesics(np.ones((3, 4), np.uint16), np.zeros((3, 4), np.uint8), 3)
    np.testing.assert_array_equal(far, plain.FAR)


@pytest.mark.parametrize("shape", [(0, 0), (0, 3), (3, 0), (1, 1), (1, 7), (7, 1)])
def test_the_smallest_images_have_distances_too(shape):
    cost, seeds = np.ones(shape, np.uint16), np.zeros(shape, np.uint8)
    seeds[-1:, :1] = 1
    for kernels in (KERNELS, plain):
        np.testing.assert_array_equal(kernels.geodesics(cost, seeds, 2), dijkstra(cost, seeds))


@pytest.mark.parametrize("seed", range(5))
def test_rounds_enough_find_the_cheapest_paths(seed):
    rng = np.random.default_rng(seed)
    cost = rng.choice(np.array([1, 5, 400], np.uint16), (20, 30))
    seeds = (rng.random(cost.shape) < 0.01).astype(np.uint8)
    seeds[10, 10] = 1
    lengths = KERNELS.geodesics(cost, seeds, AMPLE)
    np.testing.assert_array_equal(lengths, dijkstra(cost.astype(np.int64), seeds))


def test_fewer_rounds_never_make_a_path_cheaper():
    cost = np.random.default_rng(0).choice(np.array([1, 500], np.uint16), (40, 40))
    seeds = seeds_of(cost.shape, (39, 20))
    lengths = [KERNELS.geodesics(cost, seeds, rounds) for rounds in (1, 2, AMPLE)]
    assert (lengths[0] >= lengths[1]).all()
    assert (lengths[1] >= lengths[2]).all()
    assert (lengths[0] > lengths[2]).any()
