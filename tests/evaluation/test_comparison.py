"""Results side by side: which frames are compared, and what is said of them."""

import math
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from roadeval import RoadevalError
from roadeval.evaluation.comparison.compare import (
    MaskChange,
    compare,
    variants_as_sides,
)
from roadeval.evaluation.comparison.conditions import Condition, judge
from roadeval.evaluation.comparison.pairing import (
    common_masks,
    disagreements,
    match_drives,
    one_drive,
    truth_differs,
)
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.difference import Difference
from roadeval.evaluation.tables import concatenate
from tests.evaluation.making import CAMERA, a_drive, a_result, a_side, a_table, altered, table_of
from tests.evaluation.stats.test_difference import within

SETTINGS = EvaluationSettings()
POST = ("filtered", "post")


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
        "2 frames that base evaluated are left out, because new lacks them or trained on them",
    )


LATE = altered(a_side("new", [10, 20]), stamp_ns=lambda stamps: stamps + 5)
EMPTY = a_result("empty", a_drive({POST: []}))
MINE = a_result("net", a_drive({("mine", "post"): [10, 20]}))


@pytest.mark.parametrize(
    ("base", "new", "why"),
    [
        (a_side("a", [10]), a_side("b", [30], digest="d2"), "a and b are of different drives"),
        (a_side("a", [10]), a_side("b", [10], digest=None), "b does not say which log it is from"),
        (a_side("base", [10, 20]), LATE, "no evaluated frame and stage in common"),
        (a_side("base", [10, 20]), MINE, "and net mine; .* as --variant filtered=mine"),
        (EMPTY, a_side("there", [10] * 12), "empty: nothing was scored"),
        (a_side("there", [10] * 12), EMPTY, "empty: nothing was scored"),
    ],
)
def test_results_without_a_frame_in_common_are_not_compared(base, new, why):
    with pytest.raises(RoadevalError, match=why):
        compare([base, new], SETTINGS)


def test_settings_that_differ_are_named_with_both_values():
    files = {"a.onnx": {"size": 1, "digest": "d"}}
    shared = {"frames.scale": 1.0, "svm.c": 1, "labels.road": [], "net.files": files}
    more = {"a.onnx": {"size": 2, "digest": "d"}, "b.onnx": {"size": 3}}
    other = shared | {"frames.scale": 0.5, "labels.road": [3], "svm.c": 2, "net.files": more}
    base, new = (
        a_side("base", [10, 20], settings=shared),
        a_side("new", [10, 20], settings=other),
    )
    found = compare([base, altered(new, truth=lambda checksums: checksums + 1)], SETTINGS)
    of_the_log = {"frames.scale": (1.0, 0.5), "labels.road": ([], [3])}
    of_files = {"net.files.a.onnx.size": (1, 2), "net.files.b.onnx": (None, {"size": 3})}
    assert found.changed_settings == {"new": of_the_log | of_files | {"svm.c": (1, 2)}}
    assert found.warnings == (
        "base and new were replayed with different settings (`frames.scale` 1 and 0.5, "
        "`labels.road` not given and 3), which may cause a part of the change",
        "the truth differs on 2 frames between base and new, which may cause a part of the change",
    )


@pytest.mark.parametrize(
    ("scale", "other_truths", "reason"),
    [
        (0.5, 0, "base and new were replayed with `frames.scale` 1 and"),
        (1.0, 2, "the truth differs on 2 frames"),
    ],
)
def test_a_change_between_scales_or_truths_is_not_judged_but_a_level_is(
    scale, other_truths, reason
):
    base = a_side("base", [10] * 12, settings={"frames.scale": 1.0})
    new = a_side("new", [12] * 12, settings={"frames.scale": scale})
    new = altered(new, truth=lambda t: t + (np.arange(12) >= 12 - other_truths))
    found = compare([base, new], SETTINGS)
    why = unjudged(found, "post.filtered.ERR > 1pp")
    assert f"not judged in new, because {reason}" in why
    (judged,) = judge(found, [Condition.parse("post.filtered.ERR > 11%")], SETTINGS)
    assert judged.holds


def test_variants_of_a_result_that_does_not_know_its_log_are_compared_all_the_same():
    errors = {POST: [10] * 12, ("unfiltered", "post"): [12] * 12}
    street = a_result("street", a_drive(errors, digest=None))
    sides = variants_as_sides(street, ["filtered", "unfiltered"])
    found = compare(sides, SETTINGS, across_variants=True)
    assert found.changes[0].difference["ERR"].mean == pytest.approx(-0.02)


def test_final_masks_of_all_results_are_one_family_and_the_baseline_is_not_of_it():
    rng = np.random.default_rng(3)

    def a_run(label):
        masks = {
            POST: 12,
            ("filtered", "svm"): 20,
            ("unfiltered", "post"): 14,
            ("blind", "post"): 9,
        }
        own = {mask: (level + rng.integers(0, 5, 40)).tolist() for mask, level in masks.items()}
        return a_result(label, a_drive(own))

    found = compare([a_run(name) for name in ("base", "new", "newer")], SETTINGS)
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
    drives = []
    for place, own in enumerate(errors):
        about = {
            "digest": digests[place] if digests else f"d{place}",
            "group": groups[place] if groups else None,
        }
        drives.append(a_drive({POST: list(own)}, drive=str(place), **about))
    return a_result(label, *drives)


def noisy(drives, mean=10, seed=5):
    return mean + np.random.default_rng(seed).integers(-3, 4, (drives, 40))


def test_a_drive_of_a_fleet_has_the_numbers_of_the_comparison_of_its_two_results():
    base, new = a_fleet("a", noisy(8)), a_fleet("b", noisy(8, 12, 6))
    row = next(row for row in compare([base, new], SETTINGS).drives if row.drive == "3")
    alone = [replace(side, drives=side.drives[3:4]) for side in (base, new)]
    (change,) = compare(alone, SETTINGS).changes
    assert replace(change.difference["ERR"], p_holm=None, comparisons=None) == row.difference
    assert (row.base, row.new) == (change.base["ERR"], change.new["ERR"])
    assert row.difference == within(noisy(8, 12, 6)[3] / 100, noisy(8)[3] / 100)


def test_a_drive_is_compared_with_a_fleet_that_has_it():
    fleet = a_fleet("fleet", noisy(5))
    alone = a_result("alone", a_drive({POST: [20] * 40}, drive="other name", digest="d2"))
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
    drives = [
        a_drive({POST: list(own)}, drive=f"new/{place}", digest=f"d{place}")
        for place, own in enumerate(noisy(4))
    ]
    assert compare([a_fleet("a", noisy(3)), a_result("b", *drives)], SETTINGS).warnings == (
        "1 drive is left out of b (not in a): new/3",
    )


def test_half_of_the_drives_must_be_in_common_for_a_condition_on_a_change():
    digests = ["d0", "d1", "d2", "d3", *"vwxyz"]
    few = a_fleet("b", noisy(9, 12, 6), digests=digests)
    found = compare([a_fleet("a", noisy(9)), few], SETTINGS)
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


def test_frames_of_several_drives_may_be_too_few():
    fleets = [a_fleet(label, noisy(4)[:, :2]) for label in ("a", "b")]
    why = unjudged(compare(fleets, SETTINGS), "post.filtered.ERR > 1pp")
    assert "a and b have 8 evaluated frames in common, and 10 are needed; replay the same" in why


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


# --- Regions and disagreement ---------------------------------------------------------------------


def regions(wrong, drive="street", stage="post", more=0):
    """Rows of regions of 100 pixels, half of them road: wrong pixels by variant and region.

    Frame by frame; -1 is a frame without a pixel there. ``more`` pixels are other than road.
    """
    rows = []
    for (variant, region), errors in wrong.items():
        for frame, n in enumerate(errors):
            counts = {"TP": 50, "TN": 50 + more - n, "FP": n, "FN": 0, "N": 100 + more}
            counts = counts if n >= 0 else dict.fromkeys(counts, 0)
            mask = {"variant": variant, "stage": stage, "region": region}
            rows.append({"drive": drive, "frame": frame, **mask, **counts})
    return table_of("regions", rows)


def a_run(first, second, own=None):
    """A result of two variants, with rows of regions."""
    errors = {("first", "post"): first, ("second", "post"): second}
    return a_result("street", a_drive(errors, tables={"regions": own} if own is not None else {}))


def test_a_mask_may_be_better_in_one_region_and_worse_in_another():
    frames = range(40)
    rows = regions(
        {
            ("first", "lit"): [10 + n % 3 for n in frames],
            ("first", "shadow"): [10 + n % 2 for n in frames],
            ("second", "lit"): [30 + n % 5 for n in frames],
            ("second", "shadow"): [2 + n % 2 for n in frames],
        }
    )
    run = a_run([10] * 40, [16] * 40, rows)
    found = compare(variants_as_sides(run, ["first", "second"]), SETTINGS, across_variants=True)
    shadow, lit = found.regions
    assert (shadow.region, lit.region) == ("shadow", "lit")
    assert shadow.difference.high < 0 < lit.difference.low
    assert (shadow.base, shadow.new) == (pytest.approx(0.105), pytest.approx(0.025))
    assert shadow.difference.comparisons == 2
    assert (lit.variant, lit.frames) == ("second", 40)


def test_over_drives_a_region_is_the_mean_of_the_drives_that_have_it():
    wrong = {"one": {"lit": 10, "shadow": 10}, "two": {"lit": 20}}

    def run(more):
        drives = []
        for name, errors in wrong.items():
            rows = {("first", region): [own + more] * 20 for region, own in errors.items()}
            about = {"drive": name, "digest": name, "tables": {"regions": regions(rows, name)}}
            drives.append(a_drive({("first", "post"): [10] * 20}, **about))
        return a_result(f"{more} more", *drives)

    shadow, lit = compare([run(0), run(5)], SETTINGS).regions
    assert (lit.frames, lit.base, lit.new) == (40, pytest.approx(0.15), pytest.approx(0.2))
    assert (shadow.frames, shadow.base, shadow.new) == (20, pytest.approx(0.1), pytest.approx(0.15))


def test_a_region_of_other_pixels_is_left_out_and_so_is_a_frame_that_labels_none_of_it():
    lit, shadow = {("first", "lit"): [10, 20, -1] * 8}, {("first", "shadow"): [10] * 24}
    base = pd.concat([regions(lit), regions(shadow)])
    other = pd.concat([regions(lit), regions(shadow, more=1)])
    runs = [a_run([10] * 24, [20] * 24, own) for own in (base, other)]
    (row,) = compare(runs, SETTINGS).regions
    assert (row.region, row.frames, row.base) == ("lit", 16, pytest.approx(0.15))


def test_regions_of_final_masks_under_another_stage_s_name_are_compared():
    errors = {("first", "lit"): [10] * 12}
    base = a_run([10] * 12, [10] * 12, regions(errors))
    drive = a_drive({("first", "svm"): [20] * 12}, tables={"regions": regions(errors, stage="svm")})
    (row,) = compare([base, a_result("new", drive)], SETTINGS).regions
    assert (row.region, row.frames, row.difference.mean) == ("lit", 12, 0)


def disagreed(rows, seconds, *names):
    """The frames of most disagreement; rows are number, repaired and spoiled of 100 pixels."""
    keys = {"from_variant": "a", "to_variant": "b", "N": 100}
    cells = [{"frame": f, **keys, "repaired": r, "spoiled": s} for f, r, s in rows]
    stamps = (np.array(seconds) * 1e9).astype(np.int64)
    pairs = pd.DataFrame({"frame": [frame for frame, *_ in rows], "stamp_ns": stamps})
    return disagreements(table_of("disagreements", cells), pairs, *names)


def test_frames_of_most_disagreement_tell_who_is_right():
    rows = [(0, 1, 2), (40, 30, 5), (80, 0, 0)]
    first, second = disagreed(rows, [0, 4, 8], "a", "b")
    assert (first.frame, first.stamp_ns) == (40, 4 * 10**9)
    assert (first.new_right, first.base_right) == (0.30, 0.05)
    assert second.frame == 0
    (turned, _) = disagreed(rows, [0, 4, 8], "b", "a")
    assert (turned.new_right, turned.base_right) == (0.05, 0.30)


def test_neighbours_disagree_alike_and_only_one_is_named():
    rows = [(frame, 10 + frame, 0) for frame in range(30)]
    assert next(disagreed(rows, range(30), "a", "b")).frame == 29
    near = disagreed([*rows, (30, 90, 0)], [*range(30), 29.5], "a", "b")
    assert {each.frame for each in near} & {29, 30} == {30}


# --- What may be odd ------------------------------------------------------------------------------


def test_variants_that_look_like_numbers_and_frames_without_a_rate_are_compared():
    base, new = (
        a_result(label, a_drive({("10", "post"): errors}))
        for label, errors in (("base", [10, 20, 30]), ("new", [12, 26, 30]))
    )
    undefined = altered(new, ERR=lambda rates: rates.where(rates < 0.3), FP=lambda n: n)
    (change,) = compare([base, undefined], SETTINGS).changes
    assert (change.variant, change.frames) == ("10", 3)
    assert change.difference["ERR"].mean == pytest.approx(0.04)
    assert change.difference["ERR"].units == 2


def test_one_frame_alone_is_compared_without_an_interval():
    (change,) = compare([a_side("base", [10]), a_side("new", [12])], SETTINGS).changes
    told = change.difference["ERR"]
    assert (told.units, told.mean, told.low) == (1, pytest.approx(0.02), None)


def test_of_a_mask_that_is_missing_on_some_frames_those_that_have_it_are_compared():
    masks = {POST: [10] * 4, ("net", "post"): [20] * 2}
    sides = [a_result(label, a_drive(masks)) for label in ("base", "new")]
    found = compare(sides, SETTINGS)
    assert {change.variant: change.frames for change in found.changes} == {"filtered": 4, "net": 2}
    assert found.warnings == ()


def test_several_cameras_of_a_drive_are_matched_each_with_its_own():
    def a_rig(label, front, rear):
        cameras = {CAMERA: front, "/rear": rear}
        drives = [a_drive({POST: errors}, camera=name) for name, errors in cameras.items()]
        return a_result(label, *drives)

    found = compare([a_rig("a", [10] * 12, [20] * 12), a_rig("b", [13] * 12, [21] * 12)], SETTINGS)
    (change,) = found.changes
    assert (change.drives, change.frames) == (2, 24)
    assert change.difference["ERR"].mean == pytest.approx(0.02)
    assert change.difference["ERR"].unit == "frames"


# --- Which drives of two results are the same, which masks and frames; and conditions on them -----


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
    base, new = (a_table({("a", "post"): [*range(5)]}) for _ in range(2))
    stamps = base.assign(stamp_ns=[9, 5, 7, 7, 1]), new.assign(stamp_ns=[7, 9, 7, 7, 2])
    found = common_masks(*stamps)
    assert found[["frame_base", "frame"]].to_numpy().tolist() == [[0, 1], [2, 0], [3, 2]]


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


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("post.filtered.ERR > +0.5pp", ("post", "filtered", "ERR", ">", 0.5, True)),
        ("  svm.my-net_2.pooled_FNR<= 20 % ", ("svm", "my-net_2", "pooled_FNR", "<=", 20, False)),
    ],
)
def test_a_change_is_in_percentage_points_and_a_level_in_percent(text, parts):
    c = Condition.parse(text)
    assert (c.stage, c.variant, c.rate, c.operator, c.limit, c.is_change) == parts


EXAMPLE = r"as 'post\.filtered\.ERR > \+0\.5pp'"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        *((text, EXAMPLE) for text in ("", "filtered.ERR > 1pp", "surely post.filtered.ERR > 1pp")),
        *(
            (f"post.filtered.ERR {text}", EXAMPLE)
            for text in (
                *("> 0.5", ">> 0.5pp", "== 0pp", "> 1e3pp", "> nan%", "> 1pp or True"),
                *("> 1ppsurely", "> 1pp surely surely"),
            )
        ),
        ("__import__('os').system('true') > 1pp", EXAMPLE),
        ("post.filtered.EER > 1pp", "no rate EER; there are ACC, ERR"),
        ("post.filtered.ERR > 20% surely", r"a level \(%\) has none"),
        ("post.filtered.pooled_ERR > 1pp surely", "pooled_ERR has no interval"),
        ("post.filtered.IoU < -1pp surely", "has no interval; 'surely' goes with ACC, ERR"),
        ("post.filtered.TPR < -1pp surely", "has no interval; 'surely' goes with ACC, ERR"),
    ],
)
def test_anything_else_is_refused_with_an_example_or_the_reason(text, why):
    with pytest.raises(RoadevalError, match=why):
        Condition.parse(text)


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


def test_what_is_undefined_is_not_judged_as_passed():
    found = Condition.parse("post.filtered.FNR > 5%").judge(MASK)
    assert (found.holds, "undefined in new" in found.why) == (None, True)
