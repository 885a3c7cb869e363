"""Results side by side: which frames are compared, and what is said of them."""

from collections.abc import Mapping
from dataclasses import astuple, replace
from typing import get_args

import numpy as np
import pytest

from roadeval.evaluation.comparison import ComparisonError, Side, compare, variants_as_sides
from roadeval.evaluation.comparison_result import (
    DrivesDiffer,
    EndMissing,
    FramesLeftOut,
    LogUnknown,
    Note,
    SettingsDiffer,
    TruthDiffers,
    VariantLeftOut,
)
from roadeval.evaluation.conditions import Condition, ConditionError, judge
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.comparison import note
from tests.evaluation.making import a_table, rows_of

SETTINGS = EvaluationSettings()
POST = ("filtered", "post")


def a_side(label, errors, *, digest="d1", asked=None, **table):
    return Side(label, "street", digest, rows_of(a_table({POST: errors}, **table)), asked or {})


def test_a_result_against_itself_differs_by_nothing_for_sure():
    errors = [(7 * number) % 23 for number in range(40)]
    found = compare([a_side("a", errors), a_side("b", errors)], SETTINGS)
    (change,) = found.changes
    assert change.base == change.new
    for told in change.difference.values():
        assert (told.mean, told.low, told.high) == (0, 0, 0)
    assert found.moved == ()
    assert found.notes == ()


def test_differences_are_new_minus_base_on_the_frames_that_both_have():
    base, new = a_side("base", [10, 10, 10, 10]), a_side("new", [12, 14])
    found = compare([base, new], SETTINGS)
    (change,) = found.changes
    assert change.frames == 2
    assert change.base["ERR"] == pytest.approx(0.10)
    assert change.difference["ERR"].mean == pytest.approx(0.03)
    assert found.notes == (FramesLeftOut("base", "new", 2),)


def test_a_variant_that_both_have_on_no_frame_both_is_told():
    rows = rows_of(a_table({POST: [10] * 4, ("net", "post"): [20] * 4}))
    net, frame = rows["variant"] == "net", rows["frame"]
    sides = [
        Side(name, "street", "d1", rows.take(~net | mine))
        for name, mine in (("a", frame < 2), ("b", frame >= 2))
    ]
    found = compare(sides, SETTINGS)
    assert found.notes == (VariantLeftOut("a", "b", "net"),)
    assert note(found.notes[0]) == "net is left out: a and b have it on no frame both"


def test_frames_are_matched_by_their_stamps_not_by_their_numbers():
    base, new = a_side("base", [10, 20, 30]), a_side("new", [10, 20, 30])
    shifted = new.frames.replace(frame=new.frames["frame"] + 5)
    found = compare([base, Side("new", "street", "d1", shifted)], SETTINGS)
    assert found.changes[0].difference["ERR"].mean == 0


def test_frames_with_the_same_stamp_are_matched_in_their_order():
    base, new = (a_side(name, [10, 20, 30]) for name in ("base", "new"))
    frozen = [each.frames.replace(stamp_ns=np.zeros(3, int)) for each in (base, new)]
    sides = [Side(name, "street", "d1", table) for name, table in zip("ab", frozen, strict=True)]
    (change,) = compare(sides, SETTINGS).changes
    assert change.frames == 3
    assert change.difference["ERR"].mean == 0


def test_different_drives_stand_side_by_side_without_differences():
    sides = [a_side("a", [10] * 20), a_side("b", [30] * 20, digest="d2")]
    found = compare(sides, SETTINGS)
    assert not found.same_drive
    assert [change.new["ERR"] for change in found.changes] == pytest.approx([0.1, 0.3])
    assert all(change.difference == {} for change in found.changes)
    assert found.notes == (DrivesDiffer("a", "b"),)


def test_a_result_that_does_not_know_its_log_is_not_subtracted():
    sides = [a_side("a", [10] * 20), a_side("b", [10] * 20, digest=None)]
    found = compare(sides, SETTINGS)
    assert found.notes == (LogUnknown("b"),)


def test_another_truth_is_told():
    base, new = a_side("base", [10, 20]), a_side("new", [10, 20])
    relabelled = new.frames.replace(N=new.frames["N"] - 1)
    found = compare([base, Side("new", "street", "d1", relabelled)], SETTINGS)
    assert found.notes == (TruthDiffers("base", "new", 2, settings_differ=False),)


def test_settings_that_differ_are_named_with_both_values():
    asked = {"frames.scale": 1.0, "frames.every": 1, "labels.road": [], "topics.truth": "/a"}
    other = asked | {"frames.scale": 0.5, "labels.road": [3]}
    base, new = a_side("base", [10, 20], asked=asked), a_side("new", [10, 20], asked=other)
    relabelled = replace(new, frames=new.frames.replace(N=new.frames["N"] - 1))
    assert compare([base, relabelled], SETTINGS).notes == (
        SettingsDiffer("base", "new", {"frames.scale": (1.0, 0.5), "labels.road": ([], [3])}),
        TruthDiffers("base", "new", 2, settings_differ=True),
    )


@pytest.mark.parametrize("asked", [None, {"frames.scale": 1.0}])
def test_a_result_that_does_not_know_its_settings_is_compared_without_a_word(asked):
    sides = [a_side("base", [10] * 12, asked=asked), a_side("new", [12] * 12)]
    found = compare(sides, SETTINGS)
    assert found.notes == ()
    assert judge(found, [Condition.parse("post.filtered.ERR > 1pp")], SETTINGS)[0].holds


def test_a_change_between_scales_is_not_judged_but_a_level_is():
    base = a_side("base", [10] * 12, asked={"frames.scale": 1.0})
    found = compare([base, a_side("new", [12] * 12, asked={"frames.scale": 0.5})], SETTINGS)
    with pytest.raises(
        ConditionError, match=r"not judged, because .* with `frames\.scale` 1 and 0\.5"
    ):
        judge(found, [Condition.parse("post.filtered.ERR > 1pp")], SETTINGS)
    assert judge(found, [Condition.parse("post.filtered.ERR > 11%")], SETTINGS)[0].holds


def test_nothing_in_common_is_an_error():
    late = a_side("new", [10, 20])
    late = Side("new", "street", "d1", late.frames.replace(stamp_ns=late.frames["stamp_ns"] + 5))
    with pytest.raises(ComparisonError, match="no evaluated frame and stage in common"):
        compare([a_side("base", [10, 20]), late], SETTINGS)


def test_frames_that_changed_most_are_named_in_both_directions():
    base, new = a_side("base", [10] * 4, hertz=1), a_side("new", [10, 30, 10, 5], hertz=1)
    moved = compare([base, new], SETTINGS).moved
    assert [(row.frame, round(row.change, 2)) for row in moved] == [(1, 0.2), (3, -0.05)]


def test_variants_of_one_result_are_compared_with_unfiltered():
    names = ("filtered", "unfiltered", "other", "blind")
    frames = rows_of(
        a_table({(name, "post"): [10 + place] * 12 for place, name in enumerate(names)})
    )
    sides = variants_as_sides(Side("street", "street", "d1", frames))
    assert [side.label for side in sides] == ["unfiltered", "filtered", "other"]
    found = compare(sides, SETTINGS, across_variants=True)
    told = {row.variant: row.difference["ERR"].mean for row in found.changes}
    assert told == pytest.approx({"filtered": -0.01, "other": 0.01})


def test_chosen_variants_keep_their_order_and_must_be_there():
    frames = rows_of(a_table({("filtered", "post"): [1], ("unfiltered", "post"): [2]}))
    sides = variants_as_sides(Side("street", "street", "d1", frames), ["filtered", "unfiltered"])
    assert [side.label for side in sides] == ["filtered", "unfiltered"]
    with pytest.raises(ComparisonError, match="no variant net; there are filtered, unfiltered"):
        variants_as_sides(Side("street", "street", "d1", frames), ["net", "filtered"])
    with pytest.raises(ComparisonError, match="two are needed"):
        variants_as_sides(Side("street", "street", "d1", frames), ["filtered"])


def test_a_condition_is_judged_on_every_new_result():
    sides = [a_side("base", [10] * 12), a_side("good", [10] * 12), a_side("bad", [12] * 12)]
    judged = judge(compare(sides, SETTINGS), [Condition.parse("post.filtered.ERR > 1pp")], SETTINGS)
    assert [row.holds for row in judged] == [False, True]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("post.filtered.ERR > 1pp", r"base and new have 9 .* in common, and 10 are needed"),
        ("post.filtered.ERR > 1%", r"new has 9 evaluated frames, and 10 are needed"),
    ],
)
def test_a_condition_is_not_judged_by_a_handful_of_frames(text, why):
    found = compare([a_side("base", [10] * 40), a_side("new", [90] * 9)], SETTINGS)
    with pytest.raises(ConditionError, match=why):
        judge(found, [Condition.parse(text)], SETTINGS)


def test_a_level_is_not_judged_by_a_handful_of_frames_of_another_drive():
    found = compare([a_side("a", [10] * 12), a_side("b", [90] * 3, digest="d2")], SETTINGS)
    with pytest.raises(ConditionError, match="b has 3 evaluated frames, and 10 are needed"):
        judge(found, [Condition.parse("post.filtered.ERR > 1%")], SETTINGS)


def test_a_level_is_that_of_all_frames_of_the_new_result_whatever_the_base_has():
    base, new = a_side("base", [10] * 3), a_side("new", [0] * 3 + [40] * 17)
    (row,) = judge(
        compare([base, new], SETTINGS), [Condition.parse("post.filtered.ERR > 33%")], SETTINGS
    )
    assert row.after == pytest.approx(0.34)


def test_a_condition_is_not_judged_where_two_ranges_hardly_overlap():
    base, new = a_side("base", [10] * 50), a_side("new", [90] * 40)
    late = new.frames.replace(stamp_ns=new.frames["stamp_ns"] + 31 * 10**8)
    found = compare([base, Side("new", "street", "d1", late)], SETTINGS)
    assert found.changes[0].frames == 19
    with pytest.raises(ConditionError, match="fewer than half of the 40 of the shorter one"):
        judge(found, [Condition.parse("post.filtered.ERR > 1pp")], SETTINGS)


def test_a_condition_is_judged_where_half_of_the_shorter_range_is_common():
    base, new = a_side("base", [10] * 50), a_side("new", [90] * 40)
    later = new.frames.replace(stamp_ns=new.frames["stamp_ns"] + 30 * 10**8)
    found = compare([base, Side("new", "street", "d1", later)], SETTINGS)
    assert found.changes[0].frames == 20
    assert judge(found, [Condition.parse("post.filtered.ERR > 1pp")], SETTINGS)[0].holds


def test_a_condition_is_judged_where_one_result_covers_a_part_of_the_other():
    found = compare([a_side("base", [10] * 50), a_side("new", [90] * 12)], SETTINGS)
    (row,) = judge(found, [Condition.parse("post.filtered.ERR > 1pp")], SETTINGS)
    assert row.holds


def test_a_condition_on_what_is_not_there_is_an_error_not_a_pass():
    found = compare([a_side("a", [1] * 12), a_side("b", [1] * 12)], SETTINGS)
    with pytest.raises(ConditionError, match=r"post\.net; there are post\.filtered"):
        judge(found, [Condition.parse("post.net.ERR > 1pp")], SETTINGS)


def test_a_change_between_different_drives_is_not_judged_but_a_level_is():
    found = compare([a_side("a", [1] * 12), a_side("b", [9] * 12, digest="d2")], SETTINGS)
    with pytest.raises(ConditionError, match="different drives"):
        judge(found, [Condition.parse("post.filtered.ERR > 1pp")], SETTINGS)
    judged = judge(found, [Condition.parse("post.filtered.ERR > 5%")], SETTINGS)
    assert [row.holds for row in judged] == [False, True]


def test_certainty_is_judged_by_the_interval_of_any_stage_and_rate():
    base = [(7 * number) % 23 for number in range(60)]
    new = [wrong + 5 + place % 2 for place, wrong in enumerate(base)]
    sides = [a_side("a", base), a_side("b", new)]
    texts = ("post.filtered.ERR > 4pp surely", "post.filtered.FPR > 9pp surely")
    judged = judge(compare(sides, SETTINGS), [Condition.parse(text) for text in texts], SETTINGS)
    assert [row.holds for row in judged] == [True, True]


def strings(value):
    """Every text in a result."""
    match value:
        case str():
            yield value
        case Mapping():
            yield from strings([*value, *value.values()])
        case tuple() | list():
            for item in value:
                yield from strings(item)


def test_a_comparison_is_made_of_names_and_numbers_and_says_nothing():
    base = a_side("base", [10] * 40, asked={"frames.every": 1})
    new = a_side("new", [12] * 30, asked={"frames.every": 2})
    new = replace(new, frames=new.frames.replace(N=new.frames["N"] - 1))
    found = compare([base, new], SETTINGS)
    apart = compare([base, a_side("other", [10] * 12, digest="d2")], SETTINGS)
    unknown = compare([base, a_side("other", [10] * 12, digest=None)], SETTINGS)
    notes = [*found.notes, *apart.notes, *unknown.notes]
    # Whether a run reached its end is not in its tables, and a variant left out is tested above.
    assert {type(each) for each in notes} == {*get_args(Note)} - {EndMissing, VariantLeftOut}
    (judgement,) = judge(found, [Condition.parse("post.filtered.ERR>1pp")], SETTINGS)
    for result in (found, apart, unknown, judgement):
        assert not [text for text in strings(astuple(result)) if " " in text]
