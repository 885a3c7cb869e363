"""Conditions: which are accepted, and what they say."""

import math

import pytest

from roadeval.evaluation.comparison_result import MaskComparison
from roadeval.evaluation.conditions import Condition, ConditionError

MASK = MaskComparison(
    result="new",
    variant="filtered",
    stage="post",
    final=True,
    frames=12,
    base={"ERR": 0.100, "IoU": 0.8},
    new={"ERR": 0.106, "IoU": 0.7, "FNR": math.nan},
    difference={},
)


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
        ("post.filtered.IoU < -9.9pp", True),
    ],
)
def test_a_condition_holds_or_not(text, holds):
    assert Condition.parse(text).judge(MASK).holds is holds


def test_the_sentence_says_why():
    judgement = Condition.parse("post.filtered.ERR > +0.5pp").judge(MASK)
    assert judgement.sentence == (
        "post.filtered.ERR of new changed by +0.60 pp (10.00 % to 10.60 %): "
        "post.filtered.ERR > +0.5pp holds"
    )


def test_what_is_undefined_is_not_judged_as_passed():
    with pytest.raises(ConditionError, match="undefined in new"):
        Condition.parse("post.filtered.FNR > 5%").judge(MASK)
