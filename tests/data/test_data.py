"""Numbers as a person reads them."""

import math

import numpy as np
import pytest

from roadeval.data import CODES, IGNORE, best_code, histogram, wrong_above
from roadeval.data.arrays import sigmoid
from roadeval.data.words import DASH, MINUS, percent, points


@pytest.mark.parametrize(
    ("fraction", "text"), [(0.24161, "24.16"), (0.0, "0.00"), (math.nan, DASH), (None, DASH)]
)
def test_a_rate_is_in_percent_and_undefined_is_a_dash(fraction, text):
    assert percent(fraction) == text


@pytest.mark.parametrize(
    ("difference", "text"),
    [(0.0119, "+1.19"), (-0.0119, f"{MINUS}1.19"), (0.0, "0.00"), (-0.00001, "0.00"), (None, DASH)],
)
def test_a_difference_has_its_sign_unless_it_is_nothing(difference, text):
    assert points(difference) == text


# --- The threshold that errs least, against trying each -------------------------------------------


def pixels(seed, levels):
    rng = np.random.default_rng(seed)
    truth = rng.choice([0, 1, IGNORE], (20, 30)).astype(np.uint8)
    codes = rng.integers(0, levels, truth.shape) * ((CODES - 1) // levels) + 9000 * (truth == 1)
    return np.minimum(codes, CODES - 1).astype(np.uint16), truth


@pytest.mark.parametrize("levels", [3, 255, 60000])
def test_no_other_threshold_errs_less(levels):
    codes, truth = pixels(levels, levels)
    labelled = truth != IGNORE
    counts = histogram(codes, truth)
    every = [((codes > code) != (truth == 1))[labelled].sum() for code in range(0, CODES, 97)]
    assert wrong_above(counts)[::97].tolist() == every
    best = best_code(counts)
    assert ((codes > best) != (truth == 1))[labelled].sum() <= min(every)


def test_of_thresholds_that_err_alike_it_is_the_middle_one():
    counts = np.zeros((2, CODES), np.uint32)
    counts[0, 1000], counts[1, 3001] = 5, 5
    assert best_code(counts) == 2000
    assert best_code(np.zeros_like(counts)) == (CODES - 1) // 2


# --- Functions of every number of an array --------------------------------------------------------


def test_a_probability_is_the_logistic_function_of_its_log_odds_and_does_not_overflow():
    odds = np.array([-1000, -2, 0, 2, 1000], np.float32)
    expected = [0, 1 / (1 + np.exp(2)), 0.5, 1 / (1 + np.exp(-2)), 1]
    np.testing.assert_allclose(sigmoid(odds), expected, atol=1e-6)
