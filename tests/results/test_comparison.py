"""What is said of a comparison, and what its JSON file holds."""

import math

import pytest

from roadeval.evaluation.comparison_result import (
    ComparedResult,
    Comparison,
    DrivesDiffer,
    FramesLeftOut,
    LogUnknown,
    MaskComparison,
    SettingsDiffer,
    TruthDiffers,
)
from roadeval.evaluation.conditions import Condition
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import Difference
from roadeval.results.comparison import as_dict, judged, verdict, warnings


def a_change(
    mean, low=None, high=None, p=0.001, *, variant="filtered", result="new", final=True, **known
):
    """The change of a mask's ERR, in percentage points."""
    ends = [None if end is None else end / 100 for end in (low, high)]
    known = {"frames": 0 if math.isnan(mean) else 12, "effective_frames": None} | known
    change = Difference(mean / 100, *ends, 0.95, p, **known)
    rates = {"ERR": 0.1}, {"ERR": 0.1 + mean / 100}
    return MaskComparison(result, variant, "post", final, 12, *rates, {"ERR": change})


def a_comparison(*changes, notes=(), same_drive=True):
    results = tuple(ComparedResult(name, "street", "d", 12, None) for name in ("base", "new"))
    return Comparison(same_drive, results, changes, changes, (), notes, EvaluationSettings())


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (a_change(1.2, 0.5, 2), "filtered of new is worse, ERR +1.20 pp [+0.50, +2.00]"),
        (a_change(-1.2, -2, -0.5), "filtered of new is better, ERR -1.20 pp [-2.00, -0.50]"),
        (
            a_change(1.2, 0.5, 2, p_holm=0.1, comparisons=9),
            "filtered of new is probably worse, ERR +1.20 pp [+0.50, +2.00]",
        ),
        (
            a_change(-1.2, -3, 0.5, p=0.1),
            "filtered of new is probably better, ERR -1.20 pp [-3.00, +0.50]",
        ),
        (
            a_change(1.2, -0.5, 3, p=0.4),
            "filtered of new: cannot tell, ERR +1.20 pp [-0.50, +3.00]",
        ),
        (
            a_change(0.1, -0.5, 0.6, p=0.4),
            "filtered of new is neither better nor worse by more than 0.60 pp, ERR +0.10 pp "
            "[-0.50, +0.60]",
        ),
        (a_change(1.2), "filtered of new: 12 frames are too few for an interval, ERR +1.20 pp"),
        (a_change(0, 0, 0), "filtered of new has the same ERR on every frame"),
        (a_change(math.nan), "filtered of new: ERR is undefined on every frame"),
        (a_change(1, 0.5, 2, result="filtered"), "filtered is worse, ERR +1.00 pp [+0.50, +2.00]"),
    ],
)
def test_the_verdict_says_better_or_worse_and_how_sure(change, told):
    assert verdict(a_comparison(change)) == f"Against base: {told} (95 % intervals)."


def test_the_verdict_is_on_final_masks_and_leaves_the_baseline_out():
    rows = (
        a_change(9, 8, 10, final=False),
        a_change(1, 0.5, 2),
        a_change(0, 0, 0, variant="blind"),
    )
    told = verdict(a_comparison(*rows))
    assert told.count("ERR") == 1
    assert "is worse, ERR +1.00 pp" in told


def test_of_different_drives_there_is_no_difference_to_tell():
    told = verdict(a_comparison(same_drive=False))
    assert told == "Different drives, side by side: no difference is given."


@pytest.mark.parametrize(
    ("note", "told"),
    [
        (
            FramesLeftOut("a", "b", 2),
            "2 frames that a evaluated are left out against b, which lacks them or trained on them",
        ),
        (
            SettingsDiffer("a", "b", {"frames.scale": (1.0, 0.5), "labels.road": ([], [3])}),
            "a and b were replayed with different settings (`frames.scale` 1 and 0.5, "
            "`labels.road` not given and [3]): part of the change may be theirs",
        ),
        (
            TruthDiffers("a", "b", 2, settings_differ=False),
            "the truth differs on 2 frames between a and b (other labels or topics?): part of the "
            "change may be the truth's",
        ),
        (
            TruthDiffers("a", "b", 2, settings_differ=True),
            "the truth differs on 2 frames between a and b: part of the change may be the truth's",
        ),
        (LogUnknown("a"), "a does not say which log it is of: nothing is subtracted"),
        (
            DrivesDiffer("a", "b"),
            "a and b are of different drives: side by side only, for a difference would mix the "
            "scene with the method",
        ),
    ],
)
def test_each_note_is_told(note, told):
    assert warnings(a_comparison(notes=(note,))) == [told]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("post.filtered.ERR > 1pp", "changed by +1.20 pp (10.00 % to 11.20 %): {} holds"),
        ("post.filtered.ERR < 1pp", "changed by +1.20 pp (10.00 % to 11.20 %): {} does not hold"),
        (
            "post.filtered.ERR > 1pp surely",
            "changed by +1.20 pp [+0.50, +2.00] (10.00 % to 11.20 %): {} does not hold",
        ),
        ("post.filtered.ERR > 11%", "is 11.20 %: {} holds"),
    ],
)
def test_a_judged_condition_is_told_with_the_numbers_that_it_rests_on(text, told):
    judgement = Condition.parse(text).judge(a_change(1.2, 0.5, 2))
    assert judged(judgement) == f"post.filtered.ERR of new {told.format(text)}"


def test_the_file_holds_the_facts_beside_the_sentences():
    change = a_change(1.2, 0.5, 2)
    found = a_comparison(change, notes=(FramesLeftOut("base", "new", 2),))
    judgements = [Condition.parse("post.filtered.ERR > 1pp surely").judge(change)]
    content = as_dict(found, judgements)
    assert content["verdict"] == verdict(found)
    assert content["notes"] == [
        {"kind": "FramesLeftOut", "result": "base", "other": "new", "frames": 2}
    ]
    assert content["warnings"] == warnings(found)
    (condition,) = content["conditions"]
    assert condition.pop("sentence") == judged(judgements[0])
    assert condition.pop("after") == pytest.approx(0.112)
    assert condition == {
        "text": "post.filtered.ERR > 1pp surely",
        "stage": "post",
        "variant": "filtered",
        "rate": "ERR",
        "operator": ">",
        "limit": 1.0,
        "is_change": True,
        "surely": True,
        "result": "new",
        "before": 0.1,
        "low": 0.005,
        "high": 0.02,
        "holds": False,
    }
