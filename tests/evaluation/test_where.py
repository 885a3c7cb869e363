"""Where one of two masks is better: by region, and on which frames they disagree."""

import numpy as np
import pytest

from roadeval.data import Rows
from roadeval.evaluation.comparison import (
    Side,
    compare,
    disagreements,
    variants_as_sides,
)
from roadeval.evaluation.score import FrameCounts
from roadeval.evaluation.settings import EvaluationSettings
from tests.evaluation.making import a_table, compared_drive, rows_of

SETTINGS = EvaluationSettings()


def counted(wrong, pixels=100):
    """TP, TN, FP, FN and N of a region half of which is road; without a pixel for -1 wrong."""
    road = pixels // 2
    return (road, pixels - road - wrong, wrong, 0, pixels) if wrong >= 0 else (0,) * 5


def regions(wrong):
    """Rows of regions of 100 pixels: wrong pixels by variant and region, frame by frame."""
    cells = [
        (frame, variant, "post", region, *counted(errors))
        for (variant, region), own in wrong.items()
        for frame, errors in enumerate(own)
    ]
    names = ("frame", "variant", "stage", "region", "TP", "TN", "FP", "FN", "N")
    return Rows(
        {
            name: np.array(column)
            for name, column in zip(names, zip(*cells, strict=True), strict=True)
        }
    )


def pairs(rows):
    names = ("frame", "from_variant", "to_variant", "repaired", "spoiled", "N")
    return Rows(
        {
            name: np.array(column)
            for name, column in zip(names, zip(*rows, strict=True), strict=True)
        }
    )


def a_mask(frames, seconds):
    """A mask with these frames, at these times."""
    stamps = (np.array(seconds) * 1e9).astype(np.int64)
    return FrameCounts("b", "post", np.array(frames), stamps, np.zeros((len(stamps), 4), int))


def a_run(first, second, **more):
    table = a_table({("first", "post"): first, ("second", "post"): second})
    return Side("street", [compared_drive({"frames": rows_of(table), **more})])


def test_a_mask_may_be_better_in_one_region_and_worse_in_another():
    count = 40
    rows = regions(
        {
            ("first", "lit"): [10 + n % 3 for n in range(count)],
            ("first", "shadow"): [10 + n % 2 for n in range(count)],
            ("second", "lit"): [30 + n % 5 for n in range(count)],
            ("second", "shadow"): [2 + n % 2 for n in range(count)],
        }
    )
    run = a_run([10] * count, [16] * count, regions=rows)
    found = compare(variants_as_sides(run, ["first", "second"]), SETTINGS, across_variants=True)
    shadow, lit = found.regions
    assert (shadow.region, lit.region) == ("shadow", "lit")
    assert shadow.difference.high < 0 < lit.difference.low
    assert (shadow.base, shadow.new) == (pytest.approx(0.105), pytest.approx(0.025))
    assert shadow.difference.comparisons == 2
    assert (lit.variant, lit.frames) == ("second", count)


def test_over_drives_a_region_is_the_mean_of_the_drives_that_have_it():
    wrong = {"one": {"lit": 10, "shadow": 10}, "two": {"lit": 20}}

    def run(more):
        drives = []
        for name, own in wrong.items():
            rows = {("first", region): [errors + more] * 20 for region, errors in own.items()}
            tables = {"frames": rows_of(a_table({("first", "post"): [10] * 20}))}
            drives.append(
                compared_drive({**tables, "regions": regions(rows)}, drive=name, digest=name)
            )
        return Side(f"{more} more", drives)

    shadow, lit = compare([run(0), run(5)], SETTINGS).regions
    assert (lit.frames, lit.base, lit.new) == (40, pytest.approx(0.15), pytest.approx(0.2))
    assert (shadow.frames, shadow.base, shadow.new) == (20, pytest.approx(0.1), pytest.approx(0.15))


def test_a_region_of_other_pixels_is_left_out():
    base = regions({("first", "lit"): [10] * 20, ("first", "shadow"): [10] * 20})
    more = base["TN"] + (base["region"] == "shadow")
    other = base.replace(TN=more, N=base["N"] + (base["region"] == "shadow"))
    run = a_run([10] * 20, [20] * 20, regions=base)
    found = compare([run, a_run([10] * 20, [20] * 20, regions=other)], SETTINGS)
    assert [row.region for row in found.regions] == ["lit"]


def test_frames_of_most_disagreement_tell_who_is_right():
    table = pairs([(0, "a", "b", 1, 2, 100), (40, "a", "b", 30, 5, 100), (80, "a", "b", 0, 0, 100)])
    stamps = a_mask([0, 40, 80], [0, 4, 8])
    first, second = disagreements(table, stamps, "a", "b")
    assert (first.frame, first.stamp_ns) == (40, 4 * 10**9)
    assert (first.new_right, first.base_right) == (0.30, 0.05)
    assert second.frame == 0
    (turned, _) = disagreements(table, stamps, "b", "a")
    assert (turned.new_right, turned.base_right) == (0.05, 0.30)


def test_neighbours_disagree_alike_and_only_one_is_named():
    rows = [(frame, "a", "b", 10 + frame, 0, 100) for frame in range(30)]
    stamps = a_mask(range(30), range(30))
    table = pairs([*rows, (30, "a", "b", 90, 0, 100)])
    near = a_mask(range(31), [*range(30), 29.5])
    assert next(disagreements(pairs(rows), stamps, "a", "b")).frame == 29
    named = [each.frame for each in disagreements(table, near, "a", "b")]
    assert 30 in named
    assert 29 not in named
