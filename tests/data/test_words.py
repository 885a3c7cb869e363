"""Numbers as a person reads them."""

import math

import pytest

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
