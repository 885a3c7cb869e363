"""Two fleets, drive by drive."""

import math

import numpy as np
import pytest

from roadeval.evaluation.drives import AcrossSettings
from roadeval.evaluation.drives_comparison import (
    changed_drives,
    compare_drives,
    matched,
    pair_drive,
)
from roadeval.evaluation.drives_comparison_result import MaskFrames
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import mean_difference

MASK = ("filtered", "post")
SETTINGS = EvaluationSettings()


def frames(errors, stamps=None, road=50):
    """A mask's frames of 100 pixels, as many wrong as ``errors`` tells, all of them FP."""
    wrong = np.array(errors)
    counts = np.stack(
        [np.full(len(wrong), road), 100 - road - wrong, wrong, np.zeros_like(wrong)], axis=1
    )
    return {MASK: MaskFrames(np.array(range(len(wrong)) if stamps is None else stamps), counts)}


def pair(drive, base, new, *, group=None, tested=(MASK,)):
    return pair_drive(
        drive, group or drive, frames(base), frames(new), tested=tested, settings=SETTINGS
    )


def test_frames_are_matched_by_stamp_in_the_bases_order_and_equal_stamps_by_theirs():
    mine, theirs = matched(np.array([9, 5, 7, 7, 1]), np.array([7, 9, 7, 7, 2]))
    assert (mine.tolist(), theirs.tolist()) == ([0, 2, 3], [1, 0, 2])


def test_a_drive_is_compared_on_the_frames_that_both_have():
    base, new = frames([10, 20, 90], [1, 2, 3]), frames([15, 35, 99, 99], [1, 2, 8, 9])
    found = pair_drive("a", "a", base, new, tested=(), settings=SETTINGS)
    mask = found.masks[MASK]
    assert (mask.frames, found.base_left_out, found.new_left_out) == (2, 1, 2)
    assert mask.difference[1] == pytest.approx(0.10)  # ERR
    assert mask.base_counts.tolist() == [100, 70, 30, 0]
    assert mask.tested is None


def test_another_truth_is_noticed_whatever_the_masks_made_of_it():
    same = pair_drive("a", "a", frames([1, 2]), frames([9, 9]), tested=(), settings=SETTINGS)
    other = pair_drive(
        "a", "a", frames([1, 2]), frames([1, 2], road=40), tested=(), settings=SETTINGS
    )
    assert (same.truth_differs, other.truth_differs) == (0, 2)
    # As many road pixels found as before, and fewer of the others: the same truth, or another.
    mine, missed, relabelled = (
        {MASK: MaskFrames(np.array([0]), np.array([counts]))}
        for counts in ([50, 40, 10, 0], [45, 40, 10, 5], [50, 35, 10, 5])
    )
    found = [
        pair_drive("a", "a", mine, new, tested=(), settings=SETTINGS).truth_differs
        for new in (missed, relabelled)
    ]
    assert found == [0, 1]


def test_a_drives_interval_is_that_of_a_comparison_of_two_results():
    rng = np.random.default_rng(0)
    base, new = rng.integers(5, 20, (2, 40))
    told = pair("a", base, new).masks[MASK].tested
    alone = mean_difference(new / 100, base / 100, SETTINGS)
    assert (told.mean, told.low, told.high, told.p) == pytest.approx(
        (alone.mean, alone.low, alone.high, alone.p)
    )


def test_a_group_counts_as_one_and_the_change_lies_between_the_two_rates():
    pairs = [
        pair("a", [10, 10], [20, 20], group="day"),
        pair("b", [10, 10], [30, 30], group="day"),
        pair("c", [40, 40], [40, 40]),
    ]
    (change,) = compare_drives(pairs, [MASK], AcrossSettings())
    over = change.difference["ERR"]
    assert (over.drives, over.clusters, over.worse, over.equal) == (3, 2, 2, 1)
    assert over.mean == pytest.approx(0.075)
    assert change.new["ERR"] - change.base["ERR"] == pytest.approx(over.mean)
    assert change.base["pooled_ERR"] == pytest.approx(0.20)


def test_masks_are_corrected_together_and_one_that_never_changes_is_not_counted():
    rng = np.random.default_rng(1)
    pairs = []
    for drive in range(8):
        base = {(v, "post"): frames([10] * 4)[MASK] for v in ("filtered", "net", "blind")}
        new = base | {
            (v, "post"): frames(10 + rng.integers(1, 9, 4))[MASK] for v in ("filtered", "net")
        }
        pairs.append(pair_drive(str(drive), str(drive), base, new, tested=(), settings=SETTINGS))
    changes = compare_drives(pairs, [], AcrossSettings())
    assert [change.comparisons for change in changes] == [2, 2, None]
    assert changes[0].p_holm == pytest.approx(2 * changes[0].difference["ERR"].p)


def test_drives_are_ranked_and_few_of_those_called_changed_are_not():
    rng = np.random.default_rng(5)
    noise = rng.integers(-3, 4, (20, 40))
    pairs = [pair(f"same{i}", [10] * 40, 10 + noise[i]) for i in range(19)]
    pairs.append(pair("worse", [10] * 40, 25 + noise[19]))
    first, *others = changed_drives(pairs, [MASK])
    assert (first.drive, first.changed) == ("worse", True)
    assert first.q == pytest.approx(20 * first.p)
    assert any(each.p < 0.05 for each in others)
    assert not any(each.changed for each in others)


def test_a_drive_that_was_not_tested_is_not_called_changed():
    (row,) = changed_drives([pair("a", [10] * 20, [30] * 20, tested=())], [MASK])
    assert (row.p, row.q, row.changed) == (None, None, False)
    assert row.mean == pytest.approx(0.2)


def test_a_drive_without_a_defined_rate_tells_nothing():
    empty = {MASK: MaskFrames(np.arange(2), np.zeros((2, 4), np.int64))}
    nothing = pair_drive("a", "a", empty, empty, tested=(MASK,), settings=SETTINGS)
    (change,) = compare_drives([nothing], [MASK], AcrossSettings())
    assert math.isnan(change.difference["ERR"].mean)
    assert math.isnan(change.base["ERR"])
