"""Eq. 2 against SciPy and scikit-learn."""

import cv2
import numpy as np
import pytest
from scipy.spatial.distance import mahalanobis
from scipy.stats import chi2
from sklearn.covariance import EmpiricalCovariance

from roadeval.pipeline.paper import similarity
from roadeval.pipeline.paper.similarity import RIDGE, RoadColour, SimilaritySettings
from roadeval.pipeline.stage import TrainingSet, View
from tests.pipeline.images import IMAGES, noise


def sample(colours, road):
    """A training set of one frame, a row of pixels."""
    n = len(colours)
    where = np.zeros(n, np.intp)
    return TrainingSet((colours[None],), where, where, np.arange(n), np.asarray(road))


def grey_road(n=300, seed=0, spread=4.0):
    rng = np.random.default_rng(seed)
    grey = rng.normal(110, 25, (n, 1)) + rng.normal(0, spread, (n, 3))
    return np.clip(grey, 0, 255).astype(np.uint8)


def run(image, road, settings=None):
    output = similarity.bind(settings or SimilaritySettings(), road)(View.of(image))
    distance, mask = (layer.array for layer in output.layers)
    np.testing.assert_array_equal(mask, output.mask.pixels())
    return distance, mask


def test_mean_and_covariance_are_of_the_road_pixels_alone():
    colours = np.concatenate([grey_road(), noise(1, 200)[0]])
    road = np.arange(500) < 300
    fitted = similarity.fit(sample(colours, road), SimilaritySettings())
    expected = EmpiricalCovariance().fit(colours[road])
    np.testing.assert_allclose(fitted.mean, expected.location_, rtol=1e-13)
    np.testing.assert_allclose(fitted.covariance, expected.covariance_, rtol=1e-12)


@pytest.mark.parametrize("image", [*IMAGES.values(), grey_road(400).reshape(20, 20, 3)])
def test_distance_equals_scipys_on_every_pixel(image):
    image = image[:30, :30]
    road = similarity.fit(sample(grey_road(), np.full(300, True)), SimilaritySettings())
    precision = np.linalg.inv(road.covariance + RIDGE * np.eye(3))
    expected = np.array([mahalanobis(x, road.mean, precision) for x in image.reshape(-1, 3)])
    distance, mask = run(image, road)
    assert distance.dtype == np.float32
    np.testing.assert_allclose(distance.ravel(), expected, rtol=1e-6)
    np.testing.assert_array_equal(mask.ravel(), expected**2 <= chi2.ppf(0.95, 3))


@pytest.mark.parametrize("quantile", [0.5, 0.95, 0.999])
def test_a_pixel_on_the_limit_is_road(quantile):
    # Isotropic with variance 1 + ridge: d^2 = |x - m|^2 / 2, a colour 5 levels away.
    limit = chi2.ppf(quantile, 3)
    pixel = np.array([[[100, 100, 105]]], np.uint8)
    settings = SimilaritySettings(quantile=quantile)
    for spread, road in ((25 / limit * (1 + 1e-9), 1), (25 / limit * (1 - 1e-9), 0)):
        colour = RoadColour(np.full(3, 100.0), (spread - RIDGE) * np.eye(3))
        assert run(pixel, colour, settings)[1].item() == road


@pytest.mark.parametrize("ridge", [1e-3, 1.0])
def test_a_pixel_is_decided_in_double_precision_however_close_to_the_limit(ridge):
    image, road = noise(9, 70), grey_road(spread=0.0 if ridge < 1 else 4.0)
    mean = road.mean(axis=0)
    factors = similarity.whitening(np.cov(road, rowvar=False) + ridge * np.eye(3))
    squares = np.sum(np.square((image - mean) @ factors.T), axis=2)
    for row, column in ((0, 0), (3, 68), (8, 69), (5, 17)):
        for part in (1 + 1e-12, 1 - 1e-12):
            limit = squares[row, column] * part
            _, near = similarity.KERNELS.mahalanobis(cv2.split(image), mean, factors, limit)
            np.testing.assert_array_equal(near, squares <= limit)
            assert near[row, column] == (part > 1)


@pytest.mark.parametrize("colours", [np.full((9, 3), 80, np.uint8), np.full((1, 3), 80, np.uint8)])
def test_a_road_of_a_single_colour_has_the_ridge_for_its_covariance(colours):
    road = similarity.fit(sample(colours, np.full(len(colours), True)), SimilaritySettings())
    image = np.array([[[80, 80, 80], [81, 80, 80], [80, 83, 80]]], np.uint8)
    distance, mask = run(image, road)
    np.testing.assert_allclose(distance, [[0, 1, 3]], rtol=1e-7)
    assert mask.tolist() == [[1, 1, 0]]


def test_a_grey_cameras_singular_covariance_still_has_distances(monkeypatch):
    monkeypatch.setattr(similarity, "RIDGE", 1e-3)
    grey = np.repeat(np.arange(60, 200, dtype=np.uint8)[:, None], 3, axis=1)
    road = similarity.fit(sample(grey, np.full(len(grey), True)), SimilaritySettings())
    distance, _ = run(grey[None], road, SimilaritySettings())
    levels = grey[:, 0] - grey[:, 0].mean()
    np.testing.assert_allclose(distance[0], np.abs(levels) / grey[:, 0].std(), rtol=1e-4)


def test_the_distance_map_spans_three_limits():
    specs = similarity.layers(SimilaritySettings(quantile=0.9))
    assert [spec.name for spec in specs] == ["distance", "similarity"]
    assert specs[0].value_range == pytest.approx((0, 3 * chi2.ppf(0.9, 3) ** 0.5))
