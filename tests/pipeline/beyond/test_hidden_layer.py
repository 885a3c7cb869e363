"""The network beside the trees, and the mean of both."""

import warnings
from dataclasses import fields

import numpy as np
import pytest
from sklearn.neural_network import MLPClassifier

from roadeval.pipeline.beyond.features import GROUPS, SHADE, SUN, names_of
from roadeval.pipeline.beyond.hidden_layer import (
    CODES,
    PENALTY,
    HiddenLayer,
    codes_of,
    descend,
    train,
)
from roadeval.pipeline.beyond.trees import Blend, TreesSettings, grow, network_weight


def features_and_road(seed=0, count=4000):
    values = np.random.default_rng(seed).normal(size=(count, 4)).astype(np.float32)
    return values, values[:, 0] + values[:, 1] ** 2 > 0.5


def planes_of(values):
    return np.ascontiguousarray(values.T)


@pytest.fixture(scope="module")
def network():
    return train(*features_and_road(), None, 0)


def test_it_learns_what_no_plane_alone_parts(network):
    values, road = features_and_road(seed=1)
    assert ((network.sums(planes_of(values)) > 0) == road).mean() > 0.9


def test_the_same_seed_trains_the_same_network():
    sample = features_and_road(count=500)
    first, again, other = (train(*sample, None, seed) for seed in (0, 0, 1))
    for field in fields(HiddenLayer):
        np.testing.assert_array_equal(getattr(again, field.name), getattr(first, field.name))
    assert (other.planes != first.planes).any()


def test_ranks_are_even_and_codes_hold_the_range(network):
    assert (np.diff(network.ranks) >= 0).all()
    assert np.abs(network.ranks).max() <= 1
    values, _ = features_and_road()
    codes = codes_of(planes_of(values), network.lowest, network.scale)
    ranks = np.take_along_axis(network.ranks, codes.astype(np.intp), axis=1)
    np.testing.assert_allclose(ranks.mean(axis=1), 0, atol=1e-3)
    np.testing.assert_allclose(np.square(ranks).mean(axis=1), 1 / 3, atol=0.01)


def test_a_blend_is_the_weighted_mean(network):
    values, road = features_and_road()
    forest = grow(values, road, None, 10, 0)
    seen = planes_of(values)
    trees, other = forest.sums(seen), network.sums(seen)
    blend = Blend(forest, network, np.ones((1, 2), np.int32))
    for weight in (0, 0.25, 1, np.linspace(0, 1, len(other), dtype=np.float32)):
        expected = trees + np.float32(weight) * (other - trees)
        np.testing.assert_allclose(blend.log_odds(seen, weight), expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("batch", [256, 700])
def test_steps_of_one_length_are_those_of_scikit_learn_bit_for_bit(batch):
    values, road = features_and_road(count=1000)
    machine = MLPClassifier((8,), alpha=PENALTY, batch_size=batch, random_state=3)
    passes = [(values, road), (-values, ~road), (values, road)]
    for pixels, labels in passes:
        machine.partial_fit(pixels, labels, classes=[False, True])
    layers = descend(((*part, 0.001) for part in passes), 4, 8, batch, 3)
    for ours, theirs in zip(layers, (*machine.coefs_, *machine.intercepts_), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_the_sum_is_that_of_scikit_learn():
    values, road = features_and_road()
    machine = MLPClassifier((3,), max_iter=5, random_state=0)
    ranks = np.linspace(-1, 1, CODES, dtype=np.float32)[None].repeat(4, axis=0)
    lowest = np.full(4, -4, np.float32)
    scale = np.full(4, (CODES - 1) / 8, np.float32)
    seen = np.take_along_axis(
        ranks, np.rint((values.T + 4) * 255 / 8).clip(0, 255).astype(int), axis=1
    ).T
    with warnings.catch_warnings(action="ignore"):
        machine.fit(seen, road)
    (planes, out), (bias, shift) = machine.coefs_, machine.intercepts_
    ours = HiddenLayer(
        lowest,
        scale,
        ranks,
        np.ascontiguousarray(planes.T, np.float32),
        bias.astype(np.float32),
        out[:, 0].astype(np.float32),
        float(shift[0]),
    )
    probability = machine.predict_proba(seen)[:, 1]
    expected = np.log(probability / (1 - probability))
    np.testing.assert_allclose(ours.sums(planes_of(values)), expected, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize(
    ("light", "weight"), [(-2, 1 / 3), (SHADE, 1 / 3), (-0.55, 1 / 2), (SUN, 2 / 3), (1, 2 / 3)]
)
def test_the_network_has_less_to_say_in_the_shade(light, weight):
    names = names_of(tuple(GROUPS))
    values = np.zeros((len(names), 1), np.float32)
    values[names.index("light.light_over_80th_percentile")] = light
    assert network_weight(values, TreesSettings()) == pytest.approx(weight)


def test_without_a_feature_that_tells_light_the_weight_is_that_in_the_light():
    assert network_weight(np.zeros((3, 1), np.float32), TreesSettings(features=("place",))) == 2 / 3
