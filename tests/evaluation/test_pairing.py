"""Which drives of two results are the same, and which of their masks and frames."""

import numpy as np

from roadeval.evaluation.comparison import (
    Side,
    common_masks,
    match_drives,
    matched,
    one_drive,
    truth_differs,
)
from roadeval.evaluation.score import camera_masks
from tests.evaluation.making import a_table, compared_drive, rows_of

SCORED = {"frames": rows_of(a_table({("filtered", "post"): [1]}))}


def a_result(label, *drives, scored=True):
    """A result of drives, each with its digest."""
    tables = SCORED if scored else {}
    return Side(label, [compared_drive(tables, drive, digest) for drive, digest in drives])


def pairs_of(found):
    return [(one.drive, other.drive) for one, other in found[0]]


def test_drives_of_one_name_are_one_and_those_of_one_log_too():
    found = match_drives(
        a_result("base", ("a", "1"), ("b", "2"), ("c", "3")),
        a_result("new", ("moved", "2"), ("a", "1"), ("other", "9")),
    )
    assert pairs_of(found) == [("a", "a"), ("b", "moved")]
    assert found[1] == [
        "1 drive is left out of base (not in new): c",
        "1 drive is left out of new (not in base): other",
    ]


def test_a_log_that_is_in_a_result_twice_is_matched_twice_and_no_more():
    base = a_result("base", ("a", "f"), ("b", "f"), ("c", "f"))
    found = match_drives(base, a_result("new", ("x", "f"), ("y", "f")))
    assert pairs_of(found) == [("a", "x"), ("b", "y")]
    assert found[1] == ["1 drive is left out of base (not in new): c"]


def test_one_name_with_another_log_is_no_match():
    found = match_drives(a_result("base", ("a", "1")), a_result("new", ("a", "2")))
    assert not pairs_of(found)
    assert found[1] == ["1 drive is left out of base (of another log in new): a"]


def test_one_drive_of_several_is_found_where_only_that_is_compared():
    fleet, alone = a_result("fleet", ("a", "1"), ("b", "2")), a_result("alone", ("b", "2"))
    found = one_drive([fleet, alone])
    assert [side.parts[0].drive for side in found] == ["b", "b"]
    assert one_drive([fleet, fleet]) is None
    assert one_drive([fleet, a_result("other", ("c", "3"))]) is None


def test_frames_are_matched_by_stamp_in_the_bases_order_and_equal_stamps_by_theirs():
    mine, theirs = matched(np.array([9, 5, 7, 7, 1]), np.array([7, 9, 7, 7, 2]))
    assert (mine.tolist(), theirs.tolist()) == ([0, 2, 3], [1, 0, 2])


def masks_of(base, new):
    found = common_masks(*(camera_masks(rows_of(a_table(each))) for each in (base, new)))
    return [(mask.new.variant, mask.base.stage, mask.new.stage, mask.final) for mask in found]


def test_final_masks_are_matched_whatever_their_stages_are_called():
    longer = {("a", "svm"): [1], ("a", "smooth"): [1]}
    assert masks_of({("a", "svm"): [1]}, longer) == [("a", "svm", "smooth", True)]
    assert masks_of(longer, {("a", "svm"): [1]}) == [("a", "smooth", "svm", True)]


def rows_with(*truths, first=0):
    """Rows of two masks a frame, each frame with the checksum of its truth."""
    table = a_table({("a", "svm"): [1] * len(truths), ("a", "post"): [1] * len(truths)})
    return rows_of(table.assign(truth=np.repeat(truths, 2), frame=table["frame"] + first))


def test_another_truth_is_noticed_by_its_checksum_on_the_frames_that_both_have():
    assert truth_differs(rows_with(7, 8, 9), rows_with(7, 8, 9, 1, first=5)) == 0
    assert truth_differs(rows_with(7, 8, 9), rows_with(7, 5, 6, 1)) == 2
