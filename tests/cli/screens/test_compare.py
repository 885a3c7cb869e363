"""A comparison on one screen."""

import io

from rich.console import Console

from roadeval.cli.screens.compare import DRIVES, show
from roadeval.evaluation.comparison import Condition, DriveChange, Kind, Note
from tests.evaluation.making import a_change, a_comparison, a_difference

FEW = a_difference(1)
SURE = a_difference(1.2, 1, 2, p_holm=0.01, comparisons=1)


def shown(*changes, judgements=(), **more):
    out = Console(file=io.StringIO(), width=80)
    show(a_comparison(*changes, **more), judgements, out)
    return out.file.getvalue()


def test_each_result_has_a_table_even_where_one_is_called_like_a_variant():
    told = shown(a_change(FEW, result="filtered"), a_change(FEW, result="new"))
    assert "filtered against base" in told
    assert "new against base" in told


def test_the_variants_of_a_single_result_stand_together():
    told = shown(a_change(FEW, "filtered", "filtered"), a_change(FEW, "wide", "wide"))
    assert told.count("against base") == 1
    assert " ".join(told.split()).count("12 frames are too few for an interval") == 2


def test_the_screen_begins_with_the_changed_settings_and_ends_with_the_verdict():
    changed = (Note(Kind.SETTINGS, "base", "new", settings={"preset": ("paper", "gated")}),)
    told = shown(a_change(SURE), changed_settings=changed)
    assert told.startswith("Changed settings: preset paper to gated.\nnew against base\n")
    assert told.endswith("on frames \nlike these by 1.0 to 2.0 pp.\n")


def test_final_masks_have_every_rate_and_others_err():
    told = shown(a_change(FEW, stage="svm", final=False), a_change(FEW))
    lines = [line.split()[:3] for line in told.splitlines() if " 10.00 " in line]
    assert lines == [
        ["filtered", "svm", "ERR"],
        ["post", "ERR", "10.00"],
        ["FPR", "10.00", "11.00"],
        ["FNR", "10.00", "11.00"],
    ]


def test_what_stands_is_marked_and_the_mark_explained():
    told = shown(a_change(SURE))
    assert "+1.00 to +2.00 *" in told
    assert "* excludes 0; it is the only one, so nothing is corrected.\n" in told


def test_the_first_drives_that_changed_are_named_and_the_others_counted():
    def a_drive(place, q):
        about = ("new", "filtered", "post", f"drive {place}", 40, 0.2, 0.19)
        return DriveChange(*about, a_difference(-1, -2, -0.5), q)

    drives = [a_drive(place, 0.0001) for place in range(DRIVES + 2)] + [a_drive(99, 0.4)]
    told = shown(a_change(SURE, drives=13), drives=tuple(drives))
    assert told.startswith("new against base: 13 drives in common\n")
    assert "<0.001" in told
    assert f"drive {DRIVES - 1} " in told
    assert f"drive {DRIVES} " not in told
    assert "and 2 more" in told


def test_conditions_that_are_kept_are_told_and_those_that_hold_are_left_to_the_errors():
    change = a_change(SURE)
    texts = ("post.filtered.ERR > 50%", "post.filtered.ERR > 1%")
    told = shown(change, judgements=[Condition.parse(text).judge(change) for text in texts])
    assert "post.filtered.ERR > 50% does not hold\n" in told
    assert "> 1%" not in told
