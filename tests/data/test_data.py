"""Numbers as a person reads them."""

import math

import numpy as np
import pytest

from roadeval.data import CODES, ERRORS, IGNORE, best_code, colours, histogram, wrong_above
from roadeval.data.arrays import sigmoid
from roadeval.data.words import DASH, MINUS, interval, listing, number, percent, points, timestamp


@pytest.mark.parametrize(
    ("fraction", "told"), [(0.24161, "24.16"), (0.0, "0.00"), (math.nan, DASH), (None, DASH)]
)
def test_a_rate_is_in_percent_and_undefined_is_a_dash(fraction, told):
    assert percent(fraction) == told


@pytest.mark.parametrize(
    ("difference", "told"),
    [(0.0119, "+1.19"), (-0.0119, f"{MINUS}1.19"), (0.0, "0.00"), (-0.00001, "0.00"), (None, DASH)],
)
def test_a_difference_has_its_sign_unless_it_is_nothing(difference, told):
    assert points(difference) == told


def test_an_interval_is_given_or_not():
    assert interval(-0.01, 0.02) == f"{MINUS}1.00 to +2.00"
    assert interval(None, None) == "none given"


def test_a_stamp_is_a_date_where_it_can_be_one():
    assert timestamp(1_700_000_041_250_000_000) == "2023-11-14 22:14:01.250 UTC"
    assert timestamp(12_345_000_000) == "12.345 s"


def test_a_count_has_its_thousands_apart():
    assert number(15_222_322) == "15,222,322"
    assert number(999) == "999"


def test_words_are_joined():
    assert listing([]) == ""
    assert listing(["a"]) == "a"
    assert listing(["a", "b", "c"]) == "a, b and c"


# --- The threshold that errs least, against trying each -------------------------------------------


def pixels(seed, levels):
    rng = np.random.default_rng(seed)
    truth = rng.choice([0, 1, IGNORE], (20, 30)).astype(np.uint8)
    codes = rng.integers(0, levels, truth.shape) * ((CODES - 1) // levels) + 9000 * (truth == 1)
    return np.minimum(codes, CODES - 1).astype(np.uint16), truth


@pytest.mark.parametrize("levels", [3, 255, 60000])
def test_no_other_threshold_errs_less(levels):
    codes, truth = pixels(levels, levels)
    known = truth != IGNORE
    counts = histogram(codes, truth)
    every = [((codes > code) != (truth == 1))[known].sum() for code in range(0, CODES, 97)]
    assert wrong_above(counts)[::97].tolist() == every
    best = best_code(counts)
    assert ((codes > best) != (truth == 1))[known].sum() <= min(every)


def test_of_thresholds_that_err_alike_it_is_the_middle_one():
    counts = np.zeros((2, CODES), np.uint32)
    counts[0, 1000], counts[1, 3001] = 5, 5
    assert best_code(counts) == 2000
    assert best_code(np.zeros_like(counts)) == (CODES - 1) // 2


# --- The palette ----------------------------------------------------------------------------------


def test_variants_never_share_a_colour():
    given = (colours.FILTERED, colours.UNFILTERED, colours.BLIND, *colours.EXTRA)
    assert len(set(given)) == len(given)


def test_an_error_map_has_the_documented_colours():
    found = {c.name: colours.hex_of(c.rgba[:3]) for c in ERRORS.classes}
    assert found["TP"] == "#009E73"
    assert found["FP"] == "#D55E00"
    assert found["FN"] == "#CC79A7"
    assert ERRORS.classes[0].rgba == colours.CLEAR


# --- Functions of every number of an array --------------------------------------------------------


def test_a_probability_is_the_logistic_function_of_its_log_odds_and_does_not_overflow():
    odds = np.array([-1000, -2, 0, 2, 1000], np.float32)
    expected = [0, 1 / (1 + np.exp(2)), 0.5, 1 / (1 + np.exp(-2)), 1]
    np.testing.assert_allclose(sigmoid(odds), expected, atol=1e-6)
