"""Which drives of two results are the same, and which of their masks and frames."""

import numpy as np
import pytest

from roadeval.evaluation.comparison.pairing import (
    common_masks,
    match_drives,
    one_drive,
    truth_differs,
)
from roadeval.evaluation.tables import joined
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
    found = common_masks(joined([one, other]), joined([other, one]))
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
