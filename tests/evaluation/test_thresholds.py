"""Curves over thresholds, held against scikit-learn's on the same pixels."""

import math

import numpy as np
import pytest
from sklearn.metrics import average_precision_score, f1_score, precision_recall_curve

from roadeval.data import CODES, histogram
from roadeval.evaluation.score.thresholds import Thresholds, at_levels, calibration

TOP = CODES - 1


def drawn(seed, levels=CODES, share=0.3, size=(40, 50)):
    """Codes of so many levels that tell something of the truth; some pixels are ignored."""
    rng = np.random.default_rng(seed)
    truth = (rng.random(size) < share).astype(np.uint8)
    told = 1 / (1 + np.exp(-(2 * truth - 1 + rng.normal(size=size))))
    codes = (np.rint(told * (levels - 1)) * (TOP // (levels - 1))).astype(np.uint16)
    truth[:3] = 255
    return codes, truth


def flat(codes, truth):
    known = truth != 255
    return truth[known], codes[known] / TOP


CASES = [(0, CODES), (1, CODES), (2, 256), (3, 4), (4, 2)]


@pytest.mark.parametrize(("seed", "levels"), CASES)
def test_areas_and_f_are_scikit_learns(seed, levels):
    codes, truth = drawn(seed, levels)
    found, (y, p) = Thresholds.of(histogram(codes, truth)), flat(codes, truth)
    assert found.average_precision == pytest.approx(average_precision_score(y, p), abs=1e-12)
    best = found.max_f()
    assert best["MaxF"] == pytest.approx(f1_score(y, p >= best["threshold"]), abs=1e-12)
    assert 2 / (1 / best["precision"] + 1 / best["recall"]) == pytest.approx(best["MaxF"])


@pytest.mark.parametrize(("seed", "levels"), CASES)
def test_ece_is_that_of_256_bins_of_the_pixels_themselves(seed, levels):
    """As torchmetrics 1.8 has it: BinaryCalibrationError(n_bins=256, norm="l1")."""
    codes, truth = drawn(seed, levels)
    found, (y, p) = calibration(histogram(codes, truth)), flat(codes, truth)
    place = np.minimum((p * 256 * TOP / CODES).astype(int), 255)
    bins = [place == level for level in range(256)]
    ece = sum(abs(y[own].mean() - p[own].mean()) * own.mean() for own in bins if own.any())
    assert found["ECE"] == pytest.approx(ece, abs=1e-12)
    assert found["confidence"] == pytest.approx(np.maximum(p, 1 - p).mean(), abs=1e-12)
    assert found["right"] == pytest.approx(((p > (TOP + 1) / 2 / TOP) == y).mean(), abs=1e-12)


def test_probabilities_that_come_true_have_no_calibration_error():
    counts = np.zeros((2, CODES), np.int64)
    counts[:, [0, TOP // 5, TOP]] = [[7, 80, 0], [0, 20, 9]]
    assert calibration(counts)["ECE"] == pytest.approx(0)


@pytest.mark.parametrize(("seed", "levels"), CASES)
def test_curves_are_scikit_learns(seed, levels):
    codes, truth = drawn(seed, levels)
    found, (y, p) = Thresholds.of(histogram(codes, truth)), flat(codes, truth)
    precision, recall, thresholds = precision_recall_curve(y, p)
    np.testing.assert_allclose(found.precision[::-1], precision[:-1])
    np.testing.assert_allclose(found.recall[::-1], recall[:-1])
    np.testing.assert_allclose(found.codes[::-1] / TOP, thresholds)


def test_maxf_is_the_greatest_of_all_thresholds():
    codes, truth = drawn(2, 256)
    y, p = flat(codes, truth)
    best = Thresholds.of(histogram(codes, truth)).max_f()
    assert best["MaxF"] == pytest.approx(max(f1_score(y, p >= t) for t in np.unique(p)), abs=1e-12)


def test_a_perfect_probability():
    truth = np.array([[0, 0, 1, 1, 255]], np.uint8)
    codes = np.array([[0, 0, TOP, TOP, TOP]], np.uint16)
    found = Thresholds.of(histogram(codes, truth))
    assert (found.average_precision, found.max_f()["MaxF"]) == (1, 1)


@pytest.mark.parametrize("value", [0, 1, 255])
def test_what_has_no_road_or_nothing_else_is_undefined(value):
    counts = histogram(np.full((2, 2), 30_000, np.uint16), np.full((2, 2), value, np.uint8))
    found = Thresholds.of(counts)
    assert (found.max_f()["MaxF"] is None) == (value != 1)
    assert math.isnan(found.average_precision) == (value != 1)


def test_levels_hold_256_codes_each():
    counts = np.zeros((2, CODES), np.int64)
    counts[1, [0, 255, 256, TOP]] = 1, 2, 4, 8
    levels = at_levels(counts)
    assert levels.shape == (2, 256)
    assert levels[1, [0, 1, 255]].tolist() == [3, 4, 8]
