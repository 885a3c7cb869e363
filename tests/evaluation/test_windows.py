"""Rows of ten frames, against a plain groupby of pandas."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest

from roadeval.data import Counts, Tally
from roadeval.evaluation import metrics, score
from roadeval.evaluation.score import FrameCounts, GrowingCounts, sum_up


def mask_of(counts: npt.NDArray[np.int64], frames: Sequence[int], name: str = "net") -> FrameCounts:
    """A mask's counts, added frame by frame."""
    growing = GrowingCounts()
    for number, row in zip(frames, counts.tolist(), strict=True):
        growing.add(number, [Tally(name, "post", Counts(*row))])
    when = np.stack([np.arange(40), 10 * np.arange(40)], axis=1)
    return growing.so_far(when)[name, "post"]


ONES = np.ones((7, 4), np.int64)


def test_the_last_window_may_be_short() -> None:
    rows = score.windows([mask_of(ONES, range(10, 17))], size=3)
    spans = [(row["window"], row["first_frame"], row["last_frame"], row["frames"]) for row in rows]
    assert spans == [(0, 10, 12, 3), (1, 13, 15, 3), (2, 16, 16, 1)]


def test_a_mask_that_is_missing_on_some_frames_says_how_many_it_has() -> None:
    masks = mask_of(ONES, range(7), "filtered"), mask_of(ONES[:3], [0, 4, 5])
    assert masks[1].stamps.tolist() == [0, 40, 50]
    rows = [row for row in score.windows(masks, size=2) if row["variant"] == "net"]
    assert [(row["window"], row["frames"]) for row in rows] == [(0, 1), (2, 2)]
    assert (rows[1]["first_frame"], rows[1]["last_frame"]) == (4, 5)


def test_windows_equal_a_groupby_of_pandas() -> None:
    rng = np.random.default_rng(0)
    table = rng.integers(0, 3, (37, 4))
    mask = mask_of(table, range(37))
    frames = pd.DataFrame([metrics.of(Counts(*row)) for row in table.tolist()])
    counts = pd.DataFrame(table)
    groups = np.arange(37) // 10
    means = frames.groupby(groups).mean()
    sums = counts.groupby(groups).sum()
    for row in score.windows([mask], size=10):
        pooled = metrics.of(Counts(*sums.loc[row["window"]].tolist()))
        expected = means.loc[row["window"]].to_dict()
        expected |= {f"pooled_{name}": value for name, value in pooled.items()}
        assert {name: row[name] for name in expected} == pytest.approx(expected, nan_ok=True)


def test_totals_sum_counts_average_rates_and_count_the_undefined() -> None:
    totals = sum_up(np.array([[3, 1, 0, 1], [0, 4, 4, 0]]))
    assert totals["frames"] == 2
    assert [totals[name] for name in ("TP", "TN", "FP", "FN", "N")] == [3, 5, 4, 1, 13]
    assert totals["ERR"] == (1 / 5 + 4 / 8) / 2
    assert totals["pooled_ERR"] == 5 / 13
    assert totals["TPR"] == 0.75
    none = dict.fromkeys(("ACC", "ERR", "TNR", "FPR", "IoU", "mIoU", "F1", "precision"), 0)
    assert totals["undefined"] == {"TPR": 1, "FNR": 1, **none}


@pytest.mark.parametrize(
    ("name", "mean", "pooled"),
    [
        ("IoU", (3 / 4 + 1 / 3) / 2, 4 / 7),
        ("mIoU", (5 / 8 + 5 / 12) / 2, (4 / 7 + 7 / 10) / 2),
        ("F1", (6 / 7 + 2 / 4) / 2, 8 / 11),
        ("precision", (1 + 1 / 3) / 2, 4 / 6),
    ],
)
def test_totals_have_overlap_as_mean_of_frames_and_of_all_pixels(
    name: str, mean: float, pooled: float
) -> None:
    """A frame without road in mask and truth is in no mean, and counted as undefined."""
    totals = sum_up(np.array([[3, 1, 0, 1], [0, 4, 0, 0], [1, 2, 2, 0]]))
    assert totals[name] == pytest.approx(mean, abs=1e-15)
    assert totals[f"pooled_{name}"] == pytest.approx(pooled, abs=1e-15)
    assert totals["undefined"][name] == 1
