"""Conditions judged over drives."""

import math

import pytest

from roadeval.evaluation.conditions import Condition, ConditionError
from roadeval.evaluation.drives import AcrossSettings, DriveEffect, across_drives
from roadeval.evaluation.drives_comparison_result import FleetChange
from roadeval.evaluation.drives_conditions import FleetLevel, judge_over_drives

MASK = ("filtered", "post")


def a_change(means, base=0.10):
    effects = [DriveEffect(str(i), str(i), mean, 20) for i, mean in enumerate(means)]
    over = across_drives(effects, AcrossSettings())
    new = base + over.mean
    rates = {"ERR": base, "pooled_ERR": 0.2}, {"ERR": new, "pooled_ERR": 0.26}
    return FleetChange(*MASK, True, len(means), *rates, {"ERR": over})


def judged(text, change, *, smaller=None, scales=(None, None), level=0.3):
    (judgement,) = judge_over_drives(
        [Condition.parse(text)],
        [change],
        {MASK: FleetLevel(8, {"ERR": level})},
        smaller=change.drives if smaller is None else smaller,
        scales=scales,
    )
    return judgement


EIGHT = [0.01, 0.012, 0.02, 0.009, 0.011, 0.008, 0.03, 0.012]


def test_a_change_is_that_of_the_mean_over_drives():
    assert judged("post.filtered.ERR > +1.3pp", a_change(EIGHT)).holds
    assert not judged("post.filtered.ERR > +1.5pp", a_change(EIGHT)).holds


def test_surely_asks_for_the_whole_interval():
    found = judged("post.filtered.ERR > +0.8pp surely", a_change(EIGHT))
    assert found.holds
    assert 0.008 < found.low < found.change < found.high
    assert not judged("post.filtered.ERR > +1.2pp surely", a_change(EIGHT)).holds
    assert judged("post.filtered.ERR < +2.1pp surely", a_change(EIGHT)).holds


def test_surely_over_five_drives_is_an_error_with_the_reason():
    with pytest.raises(ConditionError, match=r"5 drives or groups .* too few .* 6 are needed"):
        judged("post.filtered.ERR > +0pp surely", a_change(EIGHT[:5]))
    assert judged("post.filtered.ERR > +0pp", a_change(EIGHT[:5])).holds


def test_a_level_is_the_new_fleets_own():
    assert judged("post.filtered.ERR > 20%", a_change(EIGHT)).holds
    assert not judged("post.filtered.ERR > 20%", a_change(EIGHT), level=0.1).holds


def test_a_pooled_rate_changes_by_what_all_pixels_tell():
    found = judged("post.filtered.pooled_ERR > +5pp", a_change(EIGHT))
    assert found.holds
    assert found.change == pytest.approx(0.06)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"smaller": 17}, "8 drives in common, fewer than half of the 17"),
        ({"scales": (1.0, 0.5)}, "`frames.scale` 1 and 0.5"),
    ],
)
def test_a_change_of_other_drives_or_scales_is_not_judged(options, said):
    with pytest.raises(ConditionError, match=said):
        judged("post.filtered.ERR > +0pp", a_change(EIGHT), **options)
    assert judged("post.filtered.ERR > 20%", a_change(EIGHT), **options).holds


def test_what_is_not_there_or_undefined_is_an_error():
    with pytest.raises(ConditionError, match=r"nothing compared is called svm\.filtered"):
        judged("svm.filtered.ERR > 1%", a_change(EIGHT))
    with pytest.raises(ConditionError, match="undefined"):
        judged("post.filtered.ERR > 1%", a_change(EIGHT), level=math.nan)
