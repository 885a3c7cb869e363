"""Rows of ten frames, against a plain groupby of pandas."""

import numpy as np
import pandas as pd
import pytest

from roadeval.data import Counts, Tally
from roadeval.evaluation import metrics, score
from roadeval.evaluation.score import FrameCounts, GrowingCounts, sum_up


def counts_of(*counts: tuple[int, int, int, int]) -> FrameCounts:
    growing = GrowingCounts()
    for position, row in enumerate(counts):
        growing.add(position, [Tally("filtered", "post", Counts(*row))])
    return growing.so_far()["filtered", "post"]


def test_the_last_window_may_be_short() -> None:
    rows = list(score.cut(counts_of(*[(1, 1, 1, 1)] * 7), list(range(10, 17)), size=3))
    spans = [(row.number, row.first_frame, row.last_frame, row.frames) for row in rows]
    assert spans == [(0, 10, 12, 3), (1, 13, 15, 3), (2, 16, 16, 1)]


def test_a_mask_that_is_missing_on_some_frames_says_how_many_it_has() -> None:
    growing = GrowingCounts()
    for position in (0, 4, 5):
        growing.add(position, [Tally("net", "post", Counts(1, 1, 1, 1))])
    rows = list(score.cut(growing.so_far()["net", "post"], [0, 1, 2, 3, 4, 5, 6], size=2))
    assert [(row.number, row.frames) for row in rows] == [(0, 1), (2, 2)]


def test_windows_equal_a_groupby_of_pandas() -> None:
    rng = np.random.default_rng(0)
    table = rng.integers(0, 3, (37, 4))
    mask = counts_of(*map(tuple, table.tolist()))
    frames = pd.DataFrame([metrics.of(Counts(*row)) for row in table.tolist()])
    counts = pd.DataFrame(table)
    groups = np.arange(37) // 10
    means = frames.groupby(groups).mean()
    sums = counts.groupby(groups).sum()
    for row in score.cut(mask, list(range(37)), size=10):
        assert row.rates == pytest.approx(means.loc[row.number].to_dict(), nan_ok=True)
        assert row.pooled == pytest.approx(
            metrics.of(Counts(*sums.loc[row.number].tolist())), nan_ok=True
        )


def test_totals_sum_counts_average_rates_and_count_the_undefined() -> None:
    totals = sum_up(counts_of((3, 1, 0, 1), (0, 4, 4, 0)).counts)
    assert totals["frames"] == 2
    assert [totals[name] for name in ("TP", "TN", "FP", "FN", "N")] == [3, 5, 4, 1, 13]
    assert totals["ERR"] == (1 / 5 + 4 / 8) / 2
    assert totals["pooled_ERR"] == 5 / 13
    assert totals["TPR"] == 0.75
    assert totals["undefined"] == {"ACC": 0, "ERR": 0, "TPR": 1, "FNR": 1, "TNR": 0, "FPR": 0}
