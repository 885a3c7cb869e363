"""What a difference and a comparison tell: how sure it is, in words."""

import math
from dataclasses import replace

import pytest

from roadeval.data import Counts
from roadeval.evaluation import metrics
from roadeval.evaluation.comparison.conditions import Condition
from roadeval.evaluation.stats.difference import Difference
from roadeval.results import comparison
from roadeval.results.comparison import (
    changed_settings,
    describe_judgement,
    headline,
)
from roadeval.results.sentences import (
    notes,
    sentence,
)
from tests.evaluation.making import a_change, a_comparison, a_difference

HARM = a_difference(9.2, 7.1, 11, units=91)
UNSURE = a_difference(-3.3, -20, 3.4, p=0.4, units=91)
HERE = "On these 91 frames the filter"
OVER = Difference(
    *(-0.01, -0.02, -0.004, 0.01, 0.95, "drives", 8),
    groups=8,
    worse=1,
    better=7,
    equal=0,
)


@pytest.mark.parametrize(
    ("found", "told"),
    [
        (
            HARM,
            f"{HERE} raises ERR by 9.2 pp; on frames like these by 7.1 to 11.0 pp.",
        ),
        (
            a_difference(-3.3, -8, 1.4, p=0.15, units=91),
            f"{HERE} lowers ERR by 3.3 pp; on frames like these the effect is unclear: from "
            "8.0 pp lower to 1.4 pp higher.",
        ),
        (
            a_difference(9.2, units=1, needed=10),
            "On this frame the filter raises ERR by 9.2 pp; 1 frame is too few for an interval "
            "(10 are needed).",
        ),
        (
            a_difference(0, 0, 0, p=1.0, units=91),
            f"{HERE} leaves ERR of every frame as it is.",
        ),
        (
            a_difference(math.nan),
            "Nothing to compare: ERR is undefined on every frame.",
        ),
        (
            OVER,
            "Over 8 drives the filter lowers ERR by 1.0 pp (worse on 1, better on 7); on drives "
            "like these by 0.4 to 2.0 pp.",
        ),
        (
            replace(OVER, groups=2, low=None, high=None, p=None, needed=6),
            "Over 8 drives in 2 groups the filter lowers ERR by 1.0 pp (worse on 1, better on 7); "
            "2 groups are too few for an interval (6 are needed).",
        ),
    ],
)
def test_the_fact_is_told_first_and_then_what_it_says_of_others(found, told):
    assert sentence(found, "the filter", "ERR") == told


def test_what_does_not_stand_after_correction_is_unclear_and_the_family_is_named():
    corrected = replace(HARM, p_holm=0.06, comparisons=5)
    told = sentence(corrected, "the filter", "ERR")
    assert told.endswith("unclear: from 7.1 to 11.0 pp higher (corrected for 5 comparisons).")
    alone = replace(HARM, p_holm=0.001, comparisons=1)
    assert "corrected" not in sentence(alone, "the filter", "ERR")


def test_rates_of_other_frames_than_the_difference_are_not_given():
    same, other = (({"ERR": 0.062}, {"ERR": after}) for after in (0.154, 0.2))
    assert "raises ERR from 6.2 to 15.4 %;" in sentence(HARM, "the filter", "ERR", same)
    assert "raises ERR by 9.2 pp;" in sentence(HARM, "the filter", "ERR", other)


# --- The verdict ----------------------------------------------------------------------------------


# --- Notes on a frame -----------------------------------------------------------------------------


def with_error(percent: int, road: int = 50) -> dict[str, float]:
    """Rates of a frame of 100 pixels, of which ``percent`` are called road wrongly."""
    return metrics.of(Counts(tp=road, tn=100 - road - percent, fp=percent, fn=0))


def test_a_failure_is_noted_with_its_reason() -> None:
    missed = metrics.of(Counts(tp=1, tn=80, fp=0, fn=19))
    assert tuple(notes({"net": missed}, None)) == ("net finds 5.0 % of the road.",)
    wrong = tuple(notes({"net": with_error(30)}, None))
    assert wrong == ("net gets 30.0 % of the pixels wrong.",)


WORSE = a_difference(1.2, 0.5, 2)


def test_masks_of_which_nothing_changed_are_named_in_one_sentence():
    same = a_difference(0, 0, 0)
    rows = a_change(WORSE), a_change(same, "net"), a_change(same, "wide")
    told = comparison.verdict(a_comparison(*rows))
    assert told.count("these 12 frames") == 1
    assert told.endswith("net and wide of new: every frame as in base.")
    # ERR alone may stay where other rates change.
    moved = replace(rows[1], difference={**rows[1].difference, "FPR": WORSE})
    assert "net: on these 12 frames" in comparison.verdict(a_comparison(rows[0], moved))


def test_changed_settings_are_told_of_each_result_and_some_of_many():
    chains = ["svm"], ["trees", "post"]
    settings = {"preset": ("paper", "gated"), "chain": chains, "svm.c": (1, 2)}
    changed = {"new": settings}
    found = a_comparison(a_change(WORSE), changed_settings=changed)
    assert changed_settings(found) == [
        "Changed settings: preset paper to gated; chain svm to trees, post; svm.c 1 to 2."
    ]
    rows = a_change(WORSE), a_change(WORSE, result="newer")
    several = a_comparison(*rows, changed_settings=changed)
    assert changed_settings(several, 1) == [
        "Changed settings in new: preset paper to gated; and 2 more."
    ]


@pytest.mark.parametrize(
    ("holds", "said"),
    [
        ([False], "passed, 1 limit kept"),
        ([False, False], "passed, 2 limits kept"),
        ([True], "failed, 1 of 1 limits exceeded"),
        ([True, None, False], "failed, 1 of 3 limits exceeded and 1 of 3 limits not judged"),
    ],
)
def test_the_headline_says_whether_limits_were_kept(holds, said):
    assert headline(holds) == said


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
    judgement = Condition.parse(text).judge(a_change(WORSE))
    assert describe_judgement(judgement) == f"post.filtered.ERR of new {told.format(text)}"
    assert " over 8 drives" in describe_judgement(replace(judgement, drives=8))
