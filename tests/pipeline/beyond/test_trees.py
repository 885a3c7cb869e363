"""Boosted trees against scikit-learn's, and the network beside them."""

import warnings
from dataclasses import fields, replace
from functools import partial

import numpy as np
import pytest
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.neural_network import MLPClassifier

from roadeval.data import CERTAIN, Packed
from roadeval.pipeline.beyond import trees
from roadeval.pipeline.beyond.features import (
    GROUPS,
    SHADE,
    SUN,
    names_of,
    opinion_features,
    sample_features,
)
from roadeval.pipeline.beyond.hidden_layer import (
    CODES,
    PENALTY,
    HiddenLayer,
    codes_of,
    descend,
    train,
)
from roadeval.pipeline.beyond.trees import (
    ALL,
    NODES,
    Blend,
    TreesSettings,
    class_weights,
    grow,
    network_weight,
)
from roadeval.pipeline.reference_patch import ReferencePatch
from roadeval.pipeline.scene import reach, scene_of
from roadeval.pipeline.stage import MisfitError, Output, StageError, TrainingSet, View

SMALL = TreesSettings(width=32, trees=20)


def picture(kerb, seed=0, height=24, width=32):
    """A road below a kerb, and a pavement of its grey above it; with the truth."""
    grey = np.random.default_rng(seed).integers(95, 100, (height, width, 1))
    grey[kerb] = 220
    truth = np.zeros((height, width), np.uint8)
    truth[kerb + 1 :] = 1
    return np.broadcast_to(grey, (height, width, 3)).astype(np.uint8), truth


def every_pixel(kerbs, seed=0):
    images, truths = zip(*(picture(kerb, kerb) for kerb in kerbs), strict=True)
    frame, row, column = np.indices((len(images), *truths[0].shape)).reshape(3, -1)
    return TrainingSet(tuple(images), frame, row, column, np.stack(truths).ravel() == 1, seed)


@pytest.fixture(scope="module")
def sample():
    return every_pixel((5, 9, 13))


@pytest.fixture(scope="module")
def learnt(sample):
    return trees.fit(sample, SMALL)


@pytest.fixture(scope="module")
def forest(learnt):
    return learnt.forest


def features_and_road(seed=0, count=600):
    values = np.random.default_rng(seed).normal(size=(count, 4)).astype(np.float32)
    return values, values[:, 0] + values[:, 1] ** 2 > 0.5


@pytest.mark.parametrize("weighted", [False, True])
def test_the_arrays_say_what_scikit_learns_trees_say(weighted):
    values, road = features_and_road(count=1000)
    values = values.round(0)  # so few that each has a bin, as in scikit-learn
    weights = class_weights(road, 0.2) if weighted else None
    forest = grow(values, road, weights, SMALL.trees, 0)
    sums = forest.sums(np.ascontiguousarray(values.T))
    boosting = HistGradientBoostingClassifier(
        learning_rate=trees.RATE,
        max_iter=SMALL.trees,
        max_leaf_nodes=trees.MOST_LEAVES,
        min_samples_leaf=trees.LEAST,
        max_features=trees.SHARE,
        early_stopping=False,
        random_state=0,
    ).fit(values, road, sample_weight=weights)
    np.testing.assert_allclose(sums, boosting.decision_function(values), atol=1e-5)


def test_the_same_seed_grows_the_same_trees():
    sample = every_pixel((9,))
    first, again, other = (
        trees.fit(replace(sample, seed=seed), SMALL).forest for seed in (0, 0, 1)
    )
    for field in fields(first):
        np.testing.assert_array_equal(getattr(again, field.name), getattr(first, field.name))
    assert (other.feature != first.feature).any()


def test_a_pavement_of_the_roads_grey_is_told_from_it_by_the_kerb(learnt):
    for kerb in (7, 11):
        image, truth = picture(kerb, seed=99)
        mask = trees.bind(SMALL, learnt)(View.of(image)).mask.pixels()
        assert (mask == truth).mean() > 0.95


def test_the_mask_is_where_road_is_more_probable_than_the_threshold(learnt):
    view = View.of(picture(9, seed=99)[0])
    for threshold in (0.2, 0.5, 0.9):
        output = trees.bind(replace(SMALL, threshold=threshold), learnt)(view)
        expected = output.probability > round(threshold * 65535)
        np.testing.assert_array_equal(output.mask.pixels(), expected)


def test_less_road_in_the_frames_makes_road_less_probable(sample):
    view, place = View.of(picture(9, seed=99)[0]), replace(SMALL, features=("place",))
    few, many = (
        trees.bind(place, trees.fit(replace(sample, share=share), place))(view).probability
        for share in (0.05, 0.95)
    )
    assert few.mean() < many.mean()


def test_the_mirrored_image_has_other_features_at_the_same_pixel():
    image = picture(9)[0].copy()
    image[:, :10] = 20
    sample = TrainingSet((image,), *np.array([[0], [20], [3]]), np.array([True]))
    place = replace(SMALL, features=("place",))
    straight, mirrored = sample_features(sample, partial(trees.see, place))
    np.testing.assert_allclose(straight[0, 0], -mirrored[0, 0])
    np.testing.assert_allclose(straight[0, 1:], mirrored[0, 1:])


def opinion_of(road):
    """Return the output of a method that knows the left side alone: its mask and two planes."""
    codes = np.where(road, 60000, 3000).astype(np.uint16)
    return Output(mask=Packed.of(road), by_class=(codes, 65535 - codes))


def test_a_mirrored_image_has_the_mirrored_opinion():
    image = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)
    opinion = opinion_of(np.indices((24, 32))[1] < 12)
    where = np.array([[0, 0], [20, 3], [2, 30]])
    sample = TrainingSet((image,), *where, np.array([True, False]), opinions=(opinion,))
    straight, mirrored = sample_features(sample, partial(trees.see, replace(SMALL, opinion=True)))
    count = len(names_of(SMALL.features))
    sure = np.log(60000 / 5535)
    expected = [[sure, -sure], [-np.log(62535 / 3000), np.log(62535 / 3000)]]
    np.testing.assert_allclose(straight[:, count:], expected, rtol=1e-3)
    np.testing.assert_array_equal(straight[:, count:], mirrored[:, count:])


def test_a_mask_alone_says_how_far_its_edge_is():
    mask = np.zeros((24, 32), bool)
    mask[:, :12] = True
    (signed,) = opinion_features(Output(mask=Packed.of(mask)), (24, 32))
    np.testing.assert_array_equal(signed[5, [0, 11, 12, 31]], [12, 1, -1, -20])
    everywhere = opinion_features(Output(mask=Packed.of(np.ones_like(mask))), (24, 32))
    assert np.isfinite(everywhere).all()


def test_trees_that_hear_nothing_say_so():
    heard = replace(SMALL, opinion=True)
    sample = replace(every_pixel((5, 9)), opinions=(opinion_of(picture(5)[1] > 0),) * 2)
    learnt = trees.fit(sample, heard)
    with pytest.raises(StageError, match="asks for a stage before it"):
        trees.bind(heard, learnt)(VIEW)
    more = replace(VIEW, opinion=Output(mask=sample.opinions[0].mask))
    with pytest.raises(StageError, match="gives other classes of road"):
        trees.bind(heard, learnt)(more)
    with pytest.raises(MisfitError, match="train it again"):
        trees.bind(SMALL, learnt)


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"feature": np.full((20, NODES), -1, np.int32)}, "feature holds a number outside"),
        ({"inputs": 5}, "feature holds a number outside 0 to 4"),
        ({"inputs": 0}, "feature holds a number outside 0 to -1"),
        ({"kept": np.zeros((20, NODES), np.uint32)}, "rules out a tree's last leaf"),
        ({"kept": np.full((19, NODES), ALL, np.uint32)}, "kept has the shape"),
        ({"threshold": np.full((20, NODES), np.nan, np.float32)}, "holds a number outside"),
        ({"values": np.zeros((20, 31), np.float32)}, "values has the shape"),
        ({"feature": np.zeros((20, NODES), np.int64)}, "instead of int32"),
    ],
)
def test_trees_that_no_training_gives_are_refused(forest, changed, why):
    with pytest.raises(ValueError, match=why):
        replace(forest, **changed)


def test_trees_for_other_features_are_a_misfit(learnt):
    count = len(names_of(SMALL.features))
    with pytest.raises(MisfitError, match=f"grown on {count} features .* computes 3;"):
        trees.bind(replace(SMALL, features=("place",)), learnt)


VIEW = View.of(picture(9)[0])
WIDE = View.of(picture(9, height=36, width=48)[0])
"""A view of another camera than that of `VIEW`, by its size."""


@pytest.mark.parametrize(("view", "weight"), [(VIEW, 1.0), (WIDE, 4.0)])
def test_the_distance_weighs_more_where_another_camera_taught(learnt, view, weight):
    probability, expected = (
        trees.bind(replace(SMALL, reach_weight=chosen), learnt)(view).probability
        for chosen in (None, weight)
    )
    np.testing.assert_array_equal(probability, expected)


def test_an_adapted_model_knows_the_cameras_of_both(sample, learnt):
    drawn = picture(13, height=36, width=48)
    frame, row, column = np.indices((1, *drawn[1].shape)).reshape(3, -1)
    more = trees.adapt(
        learnt, TrainingSet((drawn[0],), frame, row, column, drawn[1].ravel() == 1), SMALL
    )
    assert [more.knows(view.image) for view in (VIEW, WIDE)] == [True, True]
    assert [learnt.knows(view.image) for view in (VIEW, WIDE)] == [True, False]


@pytest.mark.parametrize(
    "groups", [("place",), ("place", "paths"), ("place", "barriers", "light", "paths")]
)
def test_lit_ground_beyond_reach_loses_log_odds_whatever_the_trees_see(sample, groups):
    without = replace(SMALL, features=groups, reach_weight=0.0)
    learnt = trees.fit(sample, without)
    plain, more = (
        trees.bind(replace(without, reach_weight=weight), learnt)(VIEW).probability / CERTAIN
        for weight in (0.0, 2.0)
    )
    scene = scene_of(VIEW.image, SMALL.width, ReferencePatch())
    light = scene.tones[0] - np.percentile(scene.tones[0][len(scene.tones[0]) // 2 :], 80)
    lit = np.interp(light, [-0.8, -0.3], [0, 1])
    expected = -2 * lit * np.maximum(reach(scene) - 1, 0)
    changed = np.log(more / (1 - more)) - np.log(plain / (1 - plain))
    # The picture is as large as the working image; a probability has a code of 16 bit.
    inside = (np.minimum(plain, more) > 0.01) & (np.maximum(plain, more) < 0.99)
    assert VIEW.image.shape[:2] == scene.shape
    assert inside.mean() > 0.1
    assert (expected[inside] < -0.1).mean() > 0.1
    assert (expected[inside] == 0).mean() > 0.1
    np.testing.assert_allclose(changed[inside], expected[inside], atol=0.01)


# --- On top of what other drives have taught ------------------------------------------------------


def test_what_stands_on_top_sees_the_base_as_its_last_feature(sample, learnt):
    adapted = trees.adapt(learnt, sample, SMALL)
    assert adapted.base is learnt
    assert adapted.inputs == learnt.inputs
    values = np.ascontiguousarray(
        np.concatenate(sample_features(sample, partial(trees.see, SMALL))).T
    )
    odds = learnt.log_odds(values, 0.5)
    top = replace(adapted, base=None)
    expected = top.log_odds(np.concatenate([values, odds[None]]), 0.5)
    np.testing.assert_array_equal(adapted.log_odds(values, 0.5), expected)
    assert (adapted.forest.feature == learnt.inputs).any()


def test_parts_that_see_other_features_are_refused(sample, learnt):
    other = trees.fit(sample, replace(SMALL, features=("place",)))
    with pytest.raises(ValueError, match="different numbers of features"):
        Blend(other.forest, learnt.network, learnt.sizes)
    with pytest.raises(ValueError, match="different numbers of features"):
        replace(other, base=other)


def values_and_road(seed=0, count=4000):
    values = np.random.default_rng(seed).normal(size=(count, 4)).astype(np.float32)
    return values, values[:, 0] + values[:, 1] ** 2 > 0.5


def planes_of(values):
    return np.ascontiguousarray(values.T)


@pytest.fixture(scope="module")
def network():
    return train(*values_and_road(), None, 0)


def test_it_learns_what_no_plane_alone_parts(network):
    values, road = values_and_road(seed=1)
    assert ((network.sums(planes_of(values)) > 0) == road).mean() > 0.9


def test_the_same_seed_trains_the_same_network():
    sample = values_and_road(count=500)
    first, again, other = (train(*sample, None, seed) for seed in (0, 0, 1))
    for field in fields(HiddenLayer):
        np.testing.assert_array_equal(getattr(again, field.name), getattr(first, field.name))
    assert (other.planes != first.planes).any()


def test_ranks_are_even_and_codes_hold_the_range(network):
    assert (np.diff(network.ranks) >= 0).all()
    assert np.abs(network.ranks).max() <= 1
    values, _ = values_and_road()
    codes = codes_of(planes_of(values), network.lowest, network.scale)
    ranks = np.take_along_axis(network.ranks, codes.astype(np.intp), axis=1)
    np.testing.assert_allclose(ranks.mean(axis=1), 0, atol=1e-3)
    np.testing.assert_allclose(np.square(ranks).mean(axis=1), 1 / 3, atol=0.01)


def test_a_blend_is_the_weighted_mean(network):
    values, road = values_and_road()
    forest = grow(values, road, None, 10, 0)
    seen = planes_of(values)
    trees, other = forest.sums(seen), network.sums(seen)
    blend = Blend(forest, network, np.ones((1, 2), np.int32))
    for weight in (0, 0.25, 1, np.linspace(0, 1, len(other), dtype=np.float32)):
        expected = trees + np.float32(weight) * (other - trees)
        np.testing.assert_allclose(blend.log_odds(seen, weight), expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("batch", [256, 700])
def test_steps_of_one_length_are_those_of_scikit_learn_bit_for_bit(batch):
    values, road = values_and_road(count=1000)
    machine = MLPClassifier((8,), alpha=PENALTY, batch_size=batch, random_state=3)
    passes = [(values, road), (-values, ~road), (values, road)]
    for pixels, labels in passes:
        machine.partial_fit(pixels, labels, classes=[False, True])
    layers = descend(((*part, 0.001) for part in passes), 4, 8, batch, 3)
    for ours, theirs in zip(layers, (*machine.coefs_, *machine.intercepts_), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_the_sum_is_that_of_scikit_learn():
    values, road = values_and_road()
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
