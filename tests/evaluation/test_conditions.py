"""Conditions: which are accepted, and what they say."""

import math
from dataclasses import replace

import pytest

from roadeval.evaluation.comparison.compare import MaskChange
from roadeval.evaluation.comparison.conditions import Condition, ConditionError
from roadeval.evaluation.stats.difference import Difference

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
        ("post.filtered.ERR > 20% surely", r"a level \(%\) .* has none"),
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
