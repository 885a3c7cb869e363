"""Rates by their formulas, and where they have no value."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn import metrics as theirs

from roadeval.data import Counts
from roadeval.evaluation.metric import Metric
from roadeval.evaluation.metrics import (
    ALL,
    OVERLAP,
    of,
    table,
)


@pytest.mark.parametrize("metric", ALL.values(), ids=ALL)
def test_a_metric_that_is_better_when_higher_rises_as_pixels_come_right(metric: Metric) -> None:
    worse, better = (metric.function(Counts(10 + n, 10 + n, 5 - n, 5 - n)) for n in (0, 1))
    assert (better > worse) is metric.higher_is_better


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
    assert all(math.isnan(metric.function(nothing)) for metric in OVERLAP.values())


@settings(max_examples=40)
@given(*[st.integers(1, 40)] * 4)
def test_rates_equal_scikit_learns(tp: int, tn: int, fp: int, fn: int) -> None:
    truth = np.repeat([1, 0, 0, 1], [tp, tn, fp, fn])
    mask = np.repeat([1, 0, 1, 0], [tp, tn, fp, fn])
    expected = {
        "ACC": theirs.accuracy_score(truth, mask),
        "ERR": theirs.zero_one_loss(truth, mask),
        "TPR": theirs.recall_score(truth, mask),
        "FNR": 1 - theirs.recall_score(truth, mask),
        "TNR": theirs.recall_score(truth, mask, pos_label=0),
        "FPR": 1 - theirs.recall_score(truth, mask, pos_label=0),
        "IoU": theirs.jaccard_score(truth, mask),
        "mIoU": theirs.jaccard_score(truth, mask, average="macro"),
        "F1": theirs.f1_score(truth, mask),
        "precision": theirs.precision_score(truth, mask),
    }
    found = {name: metric.function(Counts(tp, tn, fp, fn)) for name, metric in ALL.items()}
    assert found == pytest.approx(expected, abs=1e-12)


@given(st.lists(st.tuples(*[st.sampled_from([0, 1, 7, 2_000_000_000])] * 4), min_size=1))
def test_many_frames_rates_at_once_are_those_of_each_to_the_last_bit(
    rows: list[tuple[int, int, int, int]],
) -> None:
    single = [list(of(Counts(*row)).values()) for row in rows]
    np.testing.assert_array_equal(table(np.array(rows, np.int64)), single)
