"""Rates by their formulas, and where they have no value."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn import metrics

from roadeval.data import Counts
from roadeval.evaluation.rates import OVERLAP_RATES, RATES, of, table

pixels = st.integers(0, 40)


def test_the_papers_six_by_hand() -> None:
    assert of(Counts(tp=6, tn=80, fp=10, fn=4)) == {
        "ACC": 0.86,
        "ERR": 0.14,
        "TPR": 0.6,
        "FNR": 0.4,
        "TNR": 80 / 90,
        "FPR": 10 / 90,
    }


@pytest.mark.parametrize(
    ("counts", "undefined"),
    [
        (Counts(tn=5, fp=1), {"TPR", "FNR"}),
        (Counts(tp=5, fn=1), {"TNR", "FPR"}),
        (Counts(), {"ACC", "ERR", "TPR", "FNR", "TNR", "FPR"}),
    ],
)
def test_a_rate_without_a_denominator_is_undefined(counts: Counts, undefined: set[str]) -> None:
    assert {name for name, rate in of(counts).items() if math.isnan(rate)} == undefined


def test_overlap_is_undefined_where_there_is_nothing_to_overlap() -> None:
    nothing = Counts(tn=9)
    assert all(math.isnan(rate(nothing)) for rate in OVERLAP_RATES.values())


@given(pixels, pixels, pixels, pixels)
def test_rates_come_in_pairs_that_add_up_to_one(tp: int, tn: int, fp: int, fn: int) -> None:
    rates = of(Counts(tp, tn, fp, fn))
    for right, wrong in (("ACC", "ERR"), ("TPR", "FNR"), ("TNR", "FPR")):
        assert math.isnan(rates[right]) or math.isclose(rates[right] + rates[wrong], 1)


@given(*[st.integers(1, 40)] * 4)
def test_rates_equal_scikit_learns(tp: int, tn: int, fp: int, fn: int) -> None:
    truth = np.repeat([1, 0, 0, 1], [tp, tn, fp, fn])
    mask = np.repeat([1, 0, 1, 0], [tp, tn, fp, fn])
    expected = {
        "ACC": metrics.accuracy_score(truth, mask),
        "ERR": metrics.zero_one_loss(truth, mask),
        "TPR": metrics.recall_score(truth, mask),
        "FNR": 1 - metrics.recall_score(truth, mask),
        "TNR": metrics.recall_score(truth, mask, pos_label=0),
        "FPR": 1 - metrics.recall_score(truth, mask, pos_label=0),
        "IoU": metrics.jaccard_score(truth, mask),
        "F1": metrics.f1_score(truth, mask),
        "precision": metrics.precision_score(truth, mask),
    }
    found = {name: rate(Counts(tp, tn, fp, fn)) for name, rate in (RATES | OVERLAP_RATES).items()}
    assert found == pytest.approx(expected, abs=1e-12)


@given(st.lists(st.tuples(*[st.sampled_from([0, 1, 7, 2_000_000_000])] * 4), min_size=1))
def test_many_frames_rates_at_once_are_those_of_each_to_the_last_bit(
    rows: list[tuple[int, int, int, int]],
) -> None:
    single = [list(of(Counts(*row)).values()) for row in rows]
    np.testing.assert_array_equal(table(np.array(rows, np.int64)), single)
