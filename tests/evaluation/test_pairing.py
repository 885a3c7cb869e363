"""Which drives of two results are the same, which masks and frames; and conditions on them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from roadeval.evaluation.comparison.compare import MaskChange
from roadeval.evaluation.comparison.conditions import Condition, ConditionError
from roadeval.evaluation.comparison.pairing import (
    common_masks,
    match_drives,
    one_drive,
    truth_differs,
)
from roadeval.evaluation.stats.difference import Difference
from roadeval.evaluation.tables import concatenate
from tests.evaluation.making import a_drive, a_result, a_table, table_of


def of_drives(label, *drives):
    """A result of drives, each with its digest."""
    return a_result(label, *(a_drive({("filtered", "post"): [1]}, *drive) for drive in drives))


def pairs_of(found):
    return [(one.drive, other.drive) for one, other in found[0]]


@pytest.mark.parametrize(
    ("base", "new", "pairs", "left"),
    [
        (  # by their names, else by their logs
            [("a", "1"), ("b", "2"), ("c", "3")],
            [("moved", "2"), ("a", "1"), ("other", "9")],
            [("a", "a"), ("b", "moved")],
            [
                "1 drive is left out of base (not in new): c",
                "1 drive is left out of new (not in base): other",
            ],
        ),
        (  # a log that is in a result twice
            [("a", "f"), ("b", "f"), ("c", "f")],
            [("x", "f"), ("y", "f")],
            [("a", "x"), ("b", "y")],
            ["1 drive is left out of base (not in new): c"],
        ),
        (  # one name with two logs
            [("a", "1")],
            [("a", "2")],
            [],
            ["1 drive is left out of base (of another log in new): a"],
        ),
        (  # a result that does not say which log it is of
            [("a", "1")],
            [("a", None)],
            [],
            ["1 drive is left out of base (log unknown): a"],
        ),
    ],
)
def test_drives_of_one_name_and_log_are_one_and_all_others_are_told(base, new, pairs, left):
    found = match_drives(of_drives("base", *base), of_drives("new", *new))
    assert (pairs_of(found), found[1]) == (pairs, left)


def test_one_drive_of_several_is_found_where_only_that_is_compared():
    fleet, alone = of_drives("fleet", ("a", "1"), ("b", "2")), of_drives("alone", ("b", "2"))
    found = one_drive([fleet, alone])
    assert [side.drives[0].drive for side in found] == ["b", "b"]
    assert one_drive([fleet, fleet]) is None
    assert one_drive([fleet, of_drives("other", ("c", "3"))]) is None


def masks_of(base, new):
    found = common_masks(a_table(base), a_table(new))
    names = ["variant", "stage_base", "stage", "final"]
    return [*found[names].drop_duplicates().itertuples(index=False, name=None)]


def test_final_masks_are_matched_whatever_their_stages_are_called():
    longer = {("a", "svm"): [1], ("a", "smooth"): [1]}
    assert masks_of({("a", "svm"): [1]}, longer) == [("a", "svm", "smooth", True)]
    assert masks_of(longer, {("a", "svm"): [1]}) == [("a", "smooth", "svm", True)]
    both = {("a", "svm"): [1], ("a", "post"): [1], ("b", "post"): [1]}
    assert masks_of(both, both) == [
        ("a", "svm", "svm", False),
        ("a", "post", "post", True),
        ("b", "post", "post", True),
    ]


def test_frames_are_matched_by_stamp_and_equal_stamps_in_their_order():
    base, new = (a_table({("a", "post"): errors}) for errors in ([1, 2, 3, 4], [5, 6, 7]))
    stamps = base.assign(stamp_ns=[9, 7, 7, 1]), new.assign(stamp_ns=[7, 9, 7])
    found = common_masks(*stamps)
    assert found[["frame_base", "frame"]].to_numpy().tolist() == [[0, 1], [1, 0], [2, 2]]


def test_of_several_drives_each_is_matched_with_its_own():
    one, other = (a_table({("a", "post"): [1, 2]}, drive=name) for name in ("one", "other"))
    found = common_masks(concatenate([one, other]), concatenate([other, one]))
    assert found["drive"].tolist() == ["one", "one", "other", "other"]
    assert (found["frame"] == found["frame_base"]).all()


def test_nothing_has_nothing_in_common():
    assert len(common_masks(table_of("frames", []), a_table({("a", "post"): [1]}))) == 0
    assert truth_differs(table_of("frames", []), a_table({("a", "post"): [1]})) == 0


def rows_with(*truths, first=0):
    """Rows of two masks a frame, each frame with the checksum of its truth."""
    table = a_table({("a", "svm"): [1] * len(truths), ("a", "post"): [1] * len(truths)})
    return table.assign(truth=np.repeat(truths, 2), frame=table["frame"] + first)


@pytest.mark.parametrize(
    ("base", "new", "frames"),
    [
        (rows_with(7, 8, 9), rows_with(7, 8, 9, 1, first=5), 0),
        (rows_with(7, 8, 9), rows_with(7, 5, 6, 1), 2),
        (rows_with(7, 0, 9), rows_with(0, 5, 9), 0),  # results before 0.3 know no checksum
    ],
)
def test_another_truth_is_noticed_by_its_checksum_on_the_frames_that_both_have(base, new, frames):
    assert truth_differs(base, new) == frames


MASK = MaskChange(
    result="new",
    variant="filtered",
    stage="post",
    final=True,
    drives=1,
    frames=12,
    base={"ERR": 0.100, "IoU": 0.8},
    new={"ERR": 0.106, "IoU": 0.7, "pooled_IoU": 0.7, "FNR": math.nan},
    difference={},
)


def a_mask(low, high):
    """A mask whose ERR rose by 0.6 points, with this interval in points."""
    ends = (None, None) if low is None else (low / 100, high / 100)
    needed = 20 if low is None else None
    change = Difference(0.006, *ends, None, 0.95, "frames", 12, needed=needed)
    return replace(MASK, difference={"ERR": change})


def test_a_change_is_in_percentage_points():
    condition = Condition.parse("post.filtered.ERR > +0.5pp")
    assert (condition.stage, condition.variant, condition.rate) == ("post", "filtered", "ERR")
    assert (condition.operator, condition.limit, condition.is_change) == (">", 0.5, True)


def test_a_level_is_in_percent():
    condition = Condition.parse("  svm.my-net_2.pooled_FNR<= 20 % ")
    assert (condition.variant, condition.rate) == ("my-net_2", "pooled_FNR")
    assert (condition.operator, condition.limit, condition.is_change) == ("<=", 20.0, False)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "post.filtered.ERR > 0.5",
        "post.filtered.ERR >> 0.5pp",
        "post.filtered.ERR == 0pp",
        "filtered.ERR > 1pp",
        "post.filtered.ERR > 1e3pp",
        "post.filtered.ERR > nan%",
        "post.filtered.ERR > 1pp or True",
        "post.filtered.ERR > 1ppsurely",
        "post.filtered.ERR > 1pp surely surely",
        "surely post.filtered.ERR > 1pp",
        "__import__('os').system('true') > 1pp",
    ],
)
def test_anything_else_is_refused_with_an_example(text):
    with pytest.raises(ConditionError, match=r"as 'post\.filtered\.ERR > \+0\.5pp'"):
        Condition.parse(text)


def test_an_unknown_rate_is_told_with_those_that_there_are():
    with pytest.raises(ConditionError, match="no rate EER; there are ACC, ERR"):
        Condition.parse("post.filtered.EER > 1pp")


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("post.filtered.ERR > +0.5pp", True),
        ("post.filtered.ERR > 0.7pp", False),
        ("post.filtered.ERR < -0.1pp", False),
        ("post.filtered.ERR >= 10%", True),
        ("post.filtered.ERR > 11%", False),
        ("post.filtered.IoU < 75%", True),
        ("post.filtered.pooled_IoU < 75%", True),
        ("post.filtered.IoU < -9.9pp", True),
    ],
)
def test_a_condition_holds_or_not(text, holds):
    assert Condition.parse(text).judge(MASK).holds is holds


@pytest.mark.parametrize(
    ("limit", "interval", "holds"),
    [
        ("> +0.5pp", (0.51, 0.7), True),
        ("> +0.5pp", (0.5, 0.7), False),
        (">= +0.5pp", (0.5, 0.7), True),
        ("> +0.5pp", (0.49, 9.0), False),
        ("< -0.5pp", (-0.7, -0.51), True),
        ("< -0.5pp", (-0.7, -0.5), False),
        ("<= -0.5pp", (-0.7, -0.5), True),
        ("< -0.5pp", (-9.0, -0.49), False),
        ("> -1pp", (-0.9, 0.3), True),
    ],
)
def test_what_is_surely_so_is_so_of_the_whole_interval(limit, interval, holds):
    condition = Condition.parse(f"post.filtered.ERR {limit} surely")
    assert condition.surely
    assert condition.judge(a_mask(*interval)).holds is holds


def test_certainty_without_an_interval_is_not_judged():
    condition = Condition.parse("post.filtered.ERR > -1pp surely")
    found = condition.judge(a_mask(None, None))
    assert found.holds is None
    assert "not judged in new, because 12 frames are too few for an interval" in found.why


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("post.filtered.ERR > 20% surely", r"a level \(%\) has none"),
        ("post.filtered.pooled_ERR > 1pp surely", "pooled_ERR has no interval"),
        ("post.filtered.IoU < -1pp surely", "has no interval; 'surely' goes with ACC, ERR"),
        ("post.filtered.TPR < -1pp surely", "has no interval; 'surely' goes with ACC, ERR"),
    ],
)
def test_certainty_is_refused_where_there_is_none(text, why):
    with pytest.raises(ConditionError, match=why):
        Condition.parse(text)


def test_what_is_undefined_is_not_judged_as_passed():
    found = Condition.parse("post.filtered.FNR > 5%").judge(MASK)
    assert (found.holds, "undefined in new" in found.why) == (None, True)
