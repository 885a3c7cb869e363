"""The gated filter, on roads painted by hand, with odds that a single feature decides."""

import cv2
import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression

from roadeval.pipeline.beyond import gated
from roadeval.pipeline.beyond.gated import (
    FEATURES,
    GRID,
    GatedSettings,
    ShadedRoad,
    features_of,
    gains,
    learn_place,
    logistic,
    look,
    probability,
)
from roadeval.pipeline.stage import TrainingSet, View

HEIGHT, WIDTH = 120, 160
ROAD = np.array([120, 120, 120])
SHADE = np.array([0.38, 0.40, 0.44])
"""Shares of red, green and blue under the light of the sky alone."""
SPOT = np.s_[70:105, 50:110]
"""Where the pictures have their dark spot: on the road before the vehicle."""
BELOW = np.where(np.arange(GRID[0]) < 4, 0.01, 0.9)[:, None] * np.ones(GRID)
"""Road is likely in the lower two thirds."""
BLUE = 2
"""The feature that decides: how much bluer than lit road a pixel is, in log-chromaticity."""


def model(slope=400.0, offset=-10.0, place=BELOW):
    """Odds by blueness: shade is bluer than 0.025, all else is not."""
    planes = np.zeros((1, FEATURES), np.float32)
    planes[0, BLUE] = 1
    return ShadedRoad(place, planes, np.zeros(1, np.float32), np.full(1, slope, np.float32), offset)


def road(spot=None, where=SPOT):
    """An image of road, with a ``spot`` of another colour."""
    image = np.tile(ROAD, (HEIGHT, WIDTH, 1))
    if spot is not None:
        image[where] = np.rint(spot)
    return image.astype(np.uint8)


def run(image, learnt=None, **settings):
    output = gated.bind(GatedSettings(**settings), learnt or model())(View.of(image))
    return output, {layer.spec.name: layer.array for layer in output.layers}


# --- Candidates -----------------------------------------------------------------------------------


def test_candidates_are_darker_than_their_share_of_the_sunlit_level():
    for share, expected in ((0.58, True), (0.62, False)):
        _, layers = run(road(ROAD * share))
        assert layers["candidates"][SPOT].all() == expected
        assert not np.delete(layers["candidates"], np.s_[70:105], axis=0).any()


def test_nothing_is_a_candidate_where_no_road_was_in_training():
    sky = np.s_[5:30, 20:60]
    assert not run(road(ROAD * SHADE, sky))[1]["candidates"].any()
    everywhere = model(place=np.full(GRID, 0.9))
    assert run(road(ROAD * SHADE, sky), everywhere)[1]["candidates"][sky].all()


@pytest.mark.parametrize("exposure", [0.5, 1.0, 1.6])
def test_candidates_and_their_features_do_not_depend_on_the_exposure(exposure):
    image = np.rint(road(ROAD * SHADE) * exposure).astype(np.uint8)
    seen = look(image, BELOW)
    expected = look(road(ROAD * SHADE), BELOW)
    np.testing.assert_array_equal(seen.candidates, expected.candidates)
    np.testing.assert_allclose(
        features_of(seen)[:3, 90, 80], features_of(expected)[:3, 90, 80], atol=0.15
    )


def test_the_sunlit_level_weighs_pixels_by_how_likely_they_are_road():
    image = road()
    image[: HEIGHT // 3] = 250  # sky
    assert look(image, BELOW).level == 360
    assert look(image, np.full(GRID, 0.9)).level == 750


def test_the_level_of_a_road_mostly_in_the_shade_is_that_of_its_lit_part():
    image = road(ROAD * SHADE, np.s_[40:, :120])
    seen = look(image, BELOW)
    assert seen.level == 360
    np.testing.assert_allclose(seen.lit, ROAD)


def test_features_are_relative_to_lit_road():
    values = features_of(look(road(ROAD * SHADE), BELOW))
    dark, lit = np.rint(ROAD * SHADE) + 8, ROAD + 8
    light = np.log(dark).mean() - np.log(lit).mean()
    logs = np.log(dark / lit)
    np.testing.assert_allclose(
        values[:3, 90, 80], [light, logs[0] - logs[1], logs[2] - logs[1]], atol=1e-4
    )
    np.testing.assert_allclose(values[5, 90], values[5, 90, ::-1], atol=1e-6)
    assert values[8, HEIGHT - 1, 10] == pytest.approx(0, abs=1e-4)  # lit road alone below
    assert values[8, 40, 80] == pytest.approx(light, abs=1e-4)  # shade on the way
    assert values[-1, 90, 80] == pytest.approx(0.9)


# --- Learning -------------------------------------------------------------------------------------


def sampled(images, rows, columns, road_there, frame=None):
    frame = np.zeros(len(rows), np.intp) if frame is None else np.array(frame)
    return TrainingSet(
        tuple(images), frame, np.array(rows), np.array(columns), np.array(road_there, bool)
    )


def test_place_counts_road_by_cell_in_both_halves_alike():
    image = np.zeros((24, 32, 3), np.uint8)  # cells of two pixels
    place = learn_place(
        sampled([image], [23, 23, 22, 0], [0, 1, 30, 5], [True, True, False, False])
    )
    assert place[11, 0] == place[11, 15] == pytest.approx((1 + 2) / (2 + 3))
    assert place[0, 2] == place[0, 13] == pytest.approx(1 / 3)
    assert place[5, 5] == 0.5


def test_the_regression_is_that_of_scikit_learn():
    rng = np.random.default_rng(0)
    columns = rng.normal(size=(300, 4)) * [1, 5, 0.1, 2] + 1
    labels = columns[:, 0] + rng.normal(size=300) > 1
    weights, offset = logistic(columns, labels, 0.02)
    mean, deviation = columns.mean(axis=0), columns.std(axis=0)
    other = LogisticRegression(C=1 / (0.02 * 300), tol=1e-10, max_iter=1000)
    other.fit((columns - mean) / deviation, labels)
    np.testing.assert_allclose(weights * deviation, other.coef_[0], rtol=1e-4)
    assert offset + weights @ mean == pytest.approx(other.intercept_[0], rel=1e-4)


def test_shade_on_the_road_is_learnt_and_a_dark_car_is_not():
    image = road(ROAD * SHADE, np.s_[80:115, 20:70])
    image[80:115, 90:140] = [55, 45, 40]
    rng = np.random.default_rng(1)
    rows = rng.integers(80, 115, 200)
    columns = np.concatenate([rng.integers(20, 70, 100), rng.integers(90, 140, 100)])
    lit = rng.integers(40, 78, 100)
    sample = sampled(
        [image],
        [*rows, *lit],
        [*columns, *rng.integers(0, WIDTH, 100)],
        [True] * 100 + [False] * 100 + [True] * 100,
    )
    learnt = gated.fit(sample, GatedSettings())
    _, layers = run(image, learnt)
    assert layers["shaded"][85:110, 25:65].min() > 0.8
    assert layers["shaded"][85:110, 95:135].max() < 0.2


def test_nothing_is_brightened_where_there_was_no_shade_to_learn_from():
    image = road([40, 40, 40])
    rows, columns = np.indices((35, 60)).reshape(2, -1) + np.array([[70], [50]])
    learnt = gated.fit(sampled([image], rows, columns, np.zeros(len(rows))), GatedSettings())
    assert run(image, learnt)[0].image is image


# --- Probability and gains ------------------------------------------------------------------------


def test_the_odds_are_those_of_the_features():
    seen = look(road(ROAD * SHADE), BELOW)
    blue = features_of(seen)[BLUE, 90, 80]
    for odds in (0.25, 1.0, 4.0):
        expected = odds * np.exp(50 * blue - 3)
        values = probability(seen, model(50.0, -3.0), odds)
        assert values[90, 80] == pytest.approx(expected / (1 + expected), rel=1e-4)
        assert not values[~seen.candidates].any()


def test_shade_becomes_lit_road_each_channel_apart():
    output, layers = run(road(ROAD * SHADE))
    np.testing.assert_allclose(output.image[75:100, 55:105], 120, atol=1)
    assert layers["shadow"][SPOT].all()
    assert layers["gain"][90, 80] == pytest.approx(128 / (round(120 * 0.38) + 8), rel=1e-3)


def test_half_a_doubt_is_half_the_gain(monkeypatch):
    monkeypatch.setattr(gated, "SOFTNESS", 1)
    seen = look(road(ROAD * SHADE), BELOW)
    full, half = (gains(seen, share * seen.candidates.astype(np.float32)) for share in (1, 0.5))
    np.testing.assert_allclose(half**2, full, rtol=1e-5)


def test_shadow_is_what_is_more_likely_shaded_road_than_not(monkeypatch):
    monkeypatch.setattr(gated, "DOUBT", 0.0)
    seen = look(road(ROAD * SHADE), BELOW)
    log_odds = 50 * features_of(seen)[BLUE, 90, 80]
    for share, expected in ((0.6, 1), (0.4, 0)):
        learnt = model(50.0, np.log(share / (1 - share)) - log_odds)
        _, layers = run(road(ROAD * SHADE), learnt, odds=1.0)
        assert layers["shaded"][90, 80] == pytest.approx(share, abs=1e-3)
        assert layers["shadow"][90, 80] == expected


def test_no_gain_is_larger_than_the_greatest():
    _, layers = run(road([0, 1, 2]))
    assert layers["gain"].max() == pytest.approx(8.0)


def test_an_image_is_brightened_where_gains_are_and_nowhere_else():
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (90, 70, 3), dtype=np.uint8)
    gain = np.ones((30, 20, 3), np.float32)
    gain[12:17, 3:9] = rng.uniform(1, 4, (5, 6, 3))
    large = cv2.resize(gain, (70, 90))
    expected = np.clip(np.rint((image + 8.0) * large - 8), 0, 255)
    np.testing.assert_array_equal(gated.brighten(image, gain), expected)


def test_warm_darkness_stays_dark():
    image = road(ROAD * SHADE[::-1])
    output, layers = run(image)
    assert layers["candidates"][SPOT].all()
    assert output.image is image


@pytest.mark.parametrize(
    "image",
    [
        road(),
        np.zeros((9, 11, 3), np.uint8),
        np.full((1, 1, 3), 255, np.uint8),
        np.random.default_rng(0)
        .integers(0, 256, (60, 400, 3), dtype=np.uint8)[..., :1]
        .repeat(3, 2),
    ],
    ids=["road alone", "black", "one pixel", "grey noise"],
)
def test_a_frame_without_shade_passes_bit_for_bit(image):
    output, layers = run(image)
    assert output.image is image
    assert not layers["shadow"].any()
    assert (layers["gain"] == 1).all()
    assert output.regions["lit"].pixels().all()


# --- The stage ------------------------------------------------------------------------------------


def test_a_wide_image_is_judged_as_the_reduced_one_and_compensated_at_its_own_size():
    small = road(ROAD * SHADE)
    large = np.repeat(np.repeat(small, 3, axis=0), 3, axis=1)
    _, expected = run(small)
    output, layers = run(large)
    assert output.image.shape == large.shape
    for name in ("candidates", "shadow"):
        np.testing.assert_array_equal(layers[name][1::3, 1::3], expected[name], err_msg=name)
    np.testing.assert_allclose(output.image[225:300, 165:315], 120, atol=1)


# --- Its oracle -----------------------------------------------------------------------------------


def brightened_by_truth(image, shadow):
    """Return the image that the filter makes with the true shadow."""
    return gated.oracle(GatedSettings(), model(), View.of(image), shadow).image


def test_true_shadow_is_brightened_whatever_was_learnt():
    image = road(ROAD * SHADE[::-1])
    truth = np.zeros((HEIGHT, WIDTH), np.uint8)
    truth[SPOT] = 1
    np.testing.assert_allclose(brightened_by_truth(image, truth)[75:100, 55:105], 120, atol=1)


@pytest.mark.parametrize("nothing", np.uint8([0, 255]), ids=["no shadow", "nobody knows"])
def test_without_true_shadow_the_image_passes_bit_for_bit(nothing):
    image = road(ROAD * SHADE)
    assert brightened_by_truth(image, np.full((HEIGHT, WIDTH), nothing)) is image
