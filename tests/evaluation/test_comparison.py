"""Results side by side: which frames are compared, and what is said of them."""

import re
from dataclasses import replace

import numpy as np
import pytest

from roadeval.evaluation.comparison import (
    ComparisonError,
    Condition,
    Side,
    compare,
    judge,
    variants_as_sides,
)
from roadeval.evaluation.settings import EvaluationSettings
from tests.evaluation.making import a_part, a_side, a_table, compared_drive, rows_of
from tests.evaluation.stats.test_difference import within

SETTINGS = EvaluationSettings()
POST = ("filtered", "post")


def altered(side, **columns):
    """The result with columns of its frames replaced by what these functions make of them."""
    (part,) = side.parts
    frames = part.rows("frames")
    frames = frames.replace(**{name: make(frames[name]) for name, make in columns.items()})
    return replace(side, parts=[compared_drive({"frames": frames}, asked=part.asked)])


def unjudged(found, text):
    """Why a condition is not judged."""
    (judged,) = judge(found, [Condition.parse(text)], SETTINGS)
    assert judged.holds is None
    return judged.why


def test_differences_are_new_minus_base_on_the_frames_that_both_have():
    base, new = a_side("base", [10, 10, 10, 10]), a_side("new", [12, 14])
    found = compare([base, new], SETTINGS)
    (change,) = found.changes
    assert change.frames == 2
    assert change.base["ERR"] == pytest.approx(0.10)
    assert change.difference["ERR"].mean == pytest.approx(0.03)
    assert found.warnings == (
        "2 frames that base evaluated are left out against new, which lacks them or trained on "
        "them",
    )


def test_different_drives_are_not_compared():
    sides = [a_side("a", [10] * 20), a_side("b", [30] * 20, digest="d2")]
    with pytest.raises(ComparisonError, match="a and b are of different drives"):
        compare(sides, SETTINGS)


def test_a_result_that_does_not_know_its_log_is_not_compared():
    sides = [a_side("a", [10] * 20), a_side("b", [10] * 20, digest=None)]
    with pytest.raises(ComparisonError, match="b does not say which log it is of"):
        compare(sides, SETTINGS)


def test_settings_that_differ_are_named_with_both_values():
    asked = {"frames.scale": 1.0, "svm.c": 1, "labels.road": [], "topics.truth": "/a"}
    other = asked | {"frames.scale": 0.5, "labels.road": [3], "svm.c": 2}
    base, new = a_side("base", [10, 20], asked=asked), a_side("new", [10, 20], asked=other)
    found = compare([base, altered(new, truth=lambda checksums: checksums + 1)], SETTINGS)
    of_the_log = {"frames.scale": (1.0, 0.5), "labels.road": ([], [3])}
    assert found.changed_settings == {"new": of_the_log | {"svm.c": (1, 2)}}
    assert found.warnings == (
        "base and new were replayed with different settings (`frames.scale` 1 and 0.5, "
        "`labels.road` not given and 3): part of the change may be theirs",
        "the truth differs on 2 frames between base and new: part of the change may be the truth's",
    )


def test_a_change_between_scales_is_not_judged_but_a_level_is():
    base = a_side("base", [10] * 12, asked={"frames.scale": 1.0})
    found = compare([base, a_side("new", [12] * 12, asked={"frames.scale": 0.5})], SETTINGS)
    why = unjudged(found, "post.filtered.ERR > 1pp")
    assert "not judged in new, because base and new were replayed with `frames.scale` 1 and" in why
    (judged,) = judge(found, [Condition.parse("post.filtered.ERR > 11%")], SETTINGS)
    assert judged.holds


def test_a_change_between_truths_is_not_judged_but_a_level_is():
    base, new = a_side("base", [10] * 12), a_side("new", [12] * 12)
    found = compare([base, altered(new, truth=lambda t: t + (np.arange(12) > 9))], SETTINGS)
    assert "because the truth differs on 2 frames" in unjudged(found, "post.filtered.ERR > 1pp")
    (judged,) = judge(found, [Condition.parse("post.filtered.ERR > 11%")], SETTINGS)
    assert judged.holds


def test_nothing_in_common_is_an_error():
    late = altered(a_side("new", [10, 20]), stamp_ns=lambda stamps: stamps + 5)
    with pytest.raises(ComparisonError, match="no evaluated frame and stage in common"):
        compare([a_side("base", [10, 20]), late], SETTINGS)


def test_variants_of_a_result_that_does_not_know_its_log_are_compared_all_the_same():
    rows = rows_of(a_table({POST: [10] * 12, ("unfiltered", "post"): [12] * 12}))
    street = Side("street", [compared_drive({"frames": rows}, digest=None)])
    sides = variants_as_sides(street, ["filtered", "unfiltered"])
    found = compare(sides, SETTINGS, across_variants=True)
    assert found.changes[0].difference["ERR"].mean == pytest.approx(-0.02)


def test_final_masks_of_all_results_are_one_family_and_the_baseline_is_not_of_it():
    rng = np.random.default_rng(3)

    def a_result(label):
        masks = {
            POST: 12,
            ("filtered", "svm"): 20,
            ("unfiltered", "post"): 14,
            ("blind", "post"): 9,
        }
        own = {mask: (level + rng.integers(0, 5, 40)).tolist() for mask, level in masks.items()}
        return Side(label, [a_part(own)])

    found = compare([a_result(name) for name in ("base", "new", "newer")], SETTINGS)
    sizes = {(c.variant, c.stage): c.difference["ERR"].comparisons for c in found.changes}
    assert sizes == {
        ("filtered", "post"): 4,
        ("filtered", "svm"): None,
        ("unfiltered", "post"): 4,
        ("blind", "post"): None,
    }


# --- Several drives -------------------------------------------------------------------------------


def a_fleet(label, errors, *, groups=None, digests=None):
    """A result of drives ``0``, ``1`` ..., each with so many wrong pixels frame by frame."""
    parts = []
    for place, own in enumerate(errors):
        about = {
            "digest": digests[place] if digests else f"d{place}",
            "group": groups[place] if groups else None,
        }
        parts.append(a_part({POST: list(own)}, drive=str(place), **about))
    return Side(label, parts)


def noisy(drives, mean=10, seed=5):
    return mean + np.random.default_rng(seed).integers(-3, 4, (drives, 40))


def test_a_drive_of_a_fleet_has_the_numbers_of_the_comparison_of_its_two_results():
    base, new = a_fleet("a", noisy(8)), a_fleet("b", noisy(8, 12, 6))
    row = next(row for row in compare([base, new], SETTINGS).drives if row.drive == "3")
    alone = [replace(side, parts=side.parts[3:4]) for side in (base, new)]
    (change,) = compare(alone, SETTINGS).changes
    assert replace(change.difference["ERR"], p_holm=None, comparisons=None) == row.difference
    assert (row.base, row.new) == (change.base["ERR"], change.new["ERR"])
    assert row.difference == within(noisy(8, 12, 6)[3] / 100, noisy(8)[3] / 100)


def test_a_drive_is_compared_with_a_fleet_that_has_it():
    fleet = a_fleet("fleet", noisy(5))
    alone = Side("alone", [a_part({POST: [20] * 40}, drive="other name", digest="d2")])
    found = compare([fleet, alone], SETTINGS)
    (change,) = found.changes
    assert (change.drives, change.difference["ERR"].unit) == (1, "frames")
    assert change.base["ERR"] == pytest.approx(noisy(5)[2].mean() / 100)
    assert len(found.warnings) == 1
    assert "left out of fleet (not in alone)" in found.warnings[0]


def test_a_group_and_copies_of_a_log_count_as_one():
    errors = [[10, 10], [10, 10], [40, 40], [10, 10]]
    new = [[20, 20], [30, 30], [40, 40], [10, 10]]
    about = {"groups": ["day", "day", None, None], "digests": ["1", "2", "3", "3"]}
    found = compare([a_fleet("a", errors, **about), a_fleet("b", new, **about)], SETTINGS)
    (change,) = found.changes
    told = change.difference["ERR"]
    assert (told.units, told.groups, told.worse, told.equal) == (4, 2, 2, 2)
    assert told.mean == pytest.approx((0.15 + 0) / 2)
    assert change.new["ERR"] - change.base["ERR"] == pytest.approx(told.mean)
    assert change.base["pooled_ERR"] == pytest.approx(0.175)


def test_drives_are_ranked_and_few_of_those_called_changed_are_not():
    new = noisy(20)
    new[19] += 15
    found = compare([a_fleet("a", [[10] * 40] * 20), a_fleet("b", new)], SETTINGS)
    first, *others = found.drives
    assert (first.drive, first.changed) == ("19", True)
    assert first.q == pytest.approx(20 * first.difference.p)
    assert any(each.difference.p < 0.05 for each in others)
    assert not any(each.changed for each in others)


def test_drives_that_are_left_out_or_have_moved_are_told():
    base, new = a_fleet("a", noisy(3)), a_fleet("b", noisy(4))
    moved = [
        replace(part, drive=f"new/{part.drive}", name=f"new/{part.drive}") for part in new.parts
    ]
    assert compare([base, replace(new, parts=moved)], SETTINGS).warnings == (
        "1 drive is left out of b (not in a): new/3",
    )


def test_half_of_the_drives_must_be_in_common_for_a_condition_on_a_change():
    base, new = a_fleet("a", noisy(9)), a_fleet("b", noisy(9, 12, 6))
    few = replace(new, parts=[*new.parts[:4], *a_fleet("", noisy(5), digests="vwxyz").parts])
    renamed = [replace(p, drive=f"{i}") for i, p in enumerate(few.parts)]
    found = compare([base, replace(few, parts=renamed)], SETTINGS)
    why = unjudged(found, "post.filtered.ERR > 1pp")
    assert "have 4 drives in common, fewer than half of the 9" in why
    (judged,) = judge(found, [Condition.parse("post.filtered.ERR > 5%")], SETTINGS)
    assert judged.drives == 9


# --- Conditions -----------------------------------------------------------------------------------


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
    assert re.search(why, unjudged(found, text))


def test_a_level_is_that_of_all_frames_of_the_new_result_whatever_the_base_has():
    base, new = a_side("base", [10] * 3), a_side("new", [0] * 3 + [40] * 17)
    (row,) = judge(
        compare([base, new], SETTINGS), [Condition.parse("post.filtered.ERR > 33%")], SETTINGS
    )
    assert row.after == pytest.approx(0.34)


@pytest.mark.parametrize(("common", "holds"), [(19, None), (20, True)])
def test_a_condition_is_judged_where_half_of_the_shorter_range_is_common(common, holds):
    base, new = a_side("base", [10] * 50), a_side("new", [90] * 40)
    found = compare([base, altered(new, stamp_ns=lambda s: s + (50 - common) * 10**8)], SETTINGS)
    assert found.changes[0].frames == common
    (judged,) = judge(found, [Condition.parse("post.filtered.ERR > 1pp")], SETTINGS)
    assert judged.holds is holds
    assert holds or "fewer than half of the 40 of the smaller one" in judged.why
