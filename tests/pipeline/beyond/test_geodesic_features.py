"""Geodesic distances from the reference patch as features."""

import numpy as np
import pytest
from skimage.graph import MCP_Geometric

from roadeval.pipeline.beyond import context
from roadeval.pipeline.beyond.context import ContextSettings
from roadeval.pipeline.beyond.context_features import features
from roadeval.pipeline.beyond.geodesic_features import distance_of, from_patch, geodesics
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.pipeline.stage import TrainingSet, View

EDGES, HUES, COLOURS = range(3)
PATCH = ReferencePatch()


def street(kerb=74, height=48, width=96, seed=0):
    """A grey street, a bright kerb beside it from top to bottom, and a pavement of its grey."""
    image = np.random.default_rng(seed).integers(96, 100, (height, width, 1))
    image[:, kerb : kerb + 2] = 220
    return np.broadcast_to(image, (height, width, 3)).astype(np.uint8)


def distances(image):
    return distance_of(geodesics(image, patch_mask(*image.shape[:2], PATCH)))


def test_the_patch_itself_is_at_distance_zero():
    patch = patch_mask(48, 96, PATCH)
    np.testing.assert_allclose(distances(street())[:, patch > 0], 0, atol=1e-6)


@pytest.mark.parametrize("kind", [EDGES, HUES, COLOURS])
def test_a_kerb_is_a_step_for_whatever_lies_beyond_it(kind):
    found = distances(street())[kind]
    assert found[:, 78:].min() > 1.5 * found[:, :72].max()


def test_a_kerb_that_ends_is_walked_around():
    ends = street()
    ends[:28, 74:76] = 98
    around = distances(ends)[EDGES, 30, 84]
    assert around < 0.75 * distances(street())[EDGES, 30, 84]


def test_a_change_of_hue_without_an_edge_of_brightness_is_seen_by_two_of_the_three():
    image = np.full((48, 64, 3), 100, np.uint8)
    image[:, 44:] = 100, 100 + 18, 100 - 16  # the mean of the logarithms stays
    image[:, 44:, 0] = 100
    edges, hues, colours = distances(image)[:, 40, 60]
    assert hues > 2 * edges
    assert colours > 2 * edges


def test_distances_are_the_integrals_of_their_costs_along_the_cheapest_path():
    image = np.random.default_rng(0).integers(95, 105, (20, 30, 3), dtype=np.uint8)
    image[:8] = 250, 20, 20  # further than any cost rises
    patch = patch_mask(20, 30, PATCH)
    logs = np.log(image + 8.0)
    light = logs.mean(axis=2)
    padded = np.pad(light, 1, mode="reflect")  # as OpenCV's border
    rows = padded[:-2] + 2 * padded[1:-1] + padded[2:]
    columns = padded[:, :-2] + 2 * padded[:, 1:-1] + padded[:, 2:]
    edge = np.hypot(rows[:, 2:] - rows[:, :-2], columns[2:] - columns[:-2]) / 8
    planes = light, logs[..., 0] - logs[..., 1], logs[..., 2] - logs[..., 1]
    hue, colour = from_patch(tuple(plane.astype(np.float32) for plane in planes), patch)
    costs = edge, edge / 2 + np.minimum(hue, 10) / 20, 0.03 * np.minimum(colour, 15)
    found = distances(image)
    for cost, mine in zip(costs, found, strict=True):
        expected, _ = MCP_Geometric(0.005 + cost).find_costs(np.argwhere(patch))
        # A step aslant is 1 % shorter than the root of 2, and a cost is rounded to 1e-4.
        np.testing.assert_allclose(mine, expected, rtol=0.02, atol=0.01)


def test_distance_to_the_patch_is_in_its_own_deviations_from_its_medians():
    patch = np.array([[1, 1, 1, 1, 1, 0]], np.uint8)
    light = np.array([[1.0, 2.0, 3.0, 4.0, 50.0, 9.0]], np.float32)
    flat = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.04]], np.float32)
    hue, colour = from_patch((light, flat, flat), patch)
    assert hue[0, 5] == pytest.approx(np.hypot(2, 2))
    assert colour[0, 5] == pytest.approx(np.sqrt((6 / (1.48 + 0.06)) ** 2 + 8))
    assert colour[0, 2] == 0


def test_they_are_the_last_features_and_change_none_of_the_others():
    image = street()
    bare, more = features(image, (5,)), features(image, (5,), PATCH)
    assert len(more) == len(bare) + 3
    np.testing.assert_array_equal(more[:-3], bare)
    np.testing.assert_array_equal(more[-3:], geodesics(image, patch_mask(48, 96, PATCH)))


@pytest.mark.parametrize("level", [0, 255])
@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1), (3, 40)])
def test_images_of_one_colour_and_of_any_size_have_finite_distances(shape, level):
    found = features(np.full((*shape, 3), level, np.uint8), (5,), PATCH)
    assert np.isfinite(found).all()


def test_a_machine_learns_to_stop_at_a_kerb_wherever_it_stands():
    kerbs = (70, 75, 80, 85)
    images = [street(kerb, seed=kerb) for kerb in kerbs]
    truths = [np.broadcast_to(np.arange(96) < kerb, (48, 96)) for kerb in kerbs]
    frame, row, column = np.indices((len(kerbs), 48, 96)).reshape(3, -1)
    sample = TrainingSet(tuple(images), frame, row, column, np.stack(truths).ravel())
    wrong = {}
    for geodesic in (False, True):
        settings = ContextSettings(geodesics=geodesic, planes=48, spare=0, smoothing=1)
        run = context.bind(settings, context.fit(sample, settings))
        mask = run(View.of(street(77, seed=9))).mask.pixels()
        inner = np.r_[:75, 81:96]
        wrong[geodesic] = (mask[:, inner] != (inner < 77)).mean()
    assert wrong[True] < 0.02
    assert wrong[True] < wrong[False] / 2
