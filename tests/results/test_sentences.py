"""What a difference and a comparison tell: how sure it is, in words."""

from dataclasses import replace

import pytest

from roadeval.data import Counts
from roadeval.evaluation import metrics
from roadeval.evaluation.comparison.compare import RegionChange
from roadeval.evaluation.comparison.conditions import Condition
from roadeval.evaluation.score.degradation import Degradation
from roadeval.results import comparison
from roadeval.results.comparison import (
    changed_settings,
    describe_judgement,
    headline,
)
from roadeval.results.sentences import notes
from roadeval.results.why import describe_disturbances
from tests.evaluation.making import a_change, a_comparison, a_difference

# --- Notes on a frame -----------------------------------------------------------------------------


def with_error(percent: int, road: int = 50) -> dict[str, float]:
    """Rates of a frame of 100 pixels, of which ``percent`` are called road wrongly."""
    return metrics.of(Counts(tp=road, tn=100 - road - percent, fp=percent, fn=0))


def test_a_failure_is_noted_with_its_reason() -> None:
    missed = metrics.of(Counts(tp=1, tn=80, fp=0, fn=19))
    assert tuple(notes({"net": missed})) == ("net finds 5.0 % of the road.",)
    wrong = tuple(notes({"net": with_error(30)}))
    assert wrong == ("net gets 30.0 % of the pixels wrong.",)


WORSE = a_difference(1.2, 0.5, 2)


def test_masks_of_which_nothing_changed_are_named_in_one_sentence():
    same = a_difference(0, 0, 0)
    rows = a_change(WORSE), a_change(same, "net"), a_change(same, "wide")
    told = comparison.verdict(a_comparison(*rows))
    assert told.count("(12 frames)") == 1
    assert told.endswith("net and wide of new: every frame as in base.")
    # ERR alone may stay where other rates change.
    moved = replace(rows[1], difference={**rows[1].difference, "FPR": WORSE})
    text = comparison.verdict(a_comparison(rows[0], moved))
    assert "net of new is exactly as good as base" in text


@pytest.mark.parametrize(
    ("row", "why"),
    [
        (a_difference(8, 0.1, 17, p_holm=0.4, comparisons=9), "as 9 regions are compared"),
        (a_difference(8, -1, 17, p=0.1, p_holm=0.4, comparisons=9), "each change may be chance"),
        (a_difference(8), "no interval, as 12 frames are too few for an interval"),
    ],
)
def test_why_no_region_is_sure_is_told(row, why):
    part = RegionChange("new", "net", "lit", "in light", 12, 0.1, 0.2, row)
    assert why in comparison.where(a_comparison(a_change(WORSE, "net"), regions=(part,)))[0]


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
        ("post.filtered.ERR > 1pp", "changed by +1.20 points, from 10.00 % to 11.20 % (limit: {})"),
        (
            "post.filtered.ERR > 1pp surely",
            "changed by +1.20 points [+0.50, +2.00], from 10.00 % to 11.20 % (limit: {})",
        ),
        ("post.filtered.ERR > 11%", "is 11.20 % (limit: {})"),
    ],
)
def test_a_judged_condition_is_told_with_the_numbers_that_it_rests_on(text, told):
    judgement = Condition.parse(text).judge(a_change(WORSE))
    assert describe_judgement(judgement) == f"post.filtered.ERR of new {told.format(text)}"
    assert " over 8 drives" in describe_judgement(replace(judgement, drives=8))


# --- Disturbances ---------------------------------------------------------------------------------


def disturbed(*ends: float, p: float | None = None) -> dict[str, Degradation]:
    """Fog of rising strength; ``ends`` are ERR in percent, the first without a disturbance."""
    base, *errors = ends
    return {
        f"fog-{strength}": Degradation(
            *("fog", strength, error / 100, base / 100),
            replace(a_difference(error - base, -9, 9), p_holm=p),
        )
        for strength, error in enumerate(errors, 1)
    }


def test_what_harms_most_on_these_frames_is_told_though_it_may_be_chance():
    changes = disturbed(2, 9, 3)
    sure = replace(changes["fog-2"].difference, p_holm=0.001)
    changes["fog-2"] = replace(changes["fog-2"], difference=sure)
    sentence = describe_disturbances({"net": changes}, "net")
    assert sentence.startswith("fog:1 raises the ERR of net from 2.0 to 9.0 %")
    assert sentence.endswith("2 of 2 disturbances raise it, 1 beyond chance.")


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (disturbed(2.8, 5.9), "fog:1 raises the ERR of net from 2.8 to 5.9 % (2.1 times as high)."),
        (disturbed(2, 2.2), "fog:1 raises the ERR of net from 2.0 to 2.2 %."),
        (
            disturbed(2, 6, 1),
            "fog:1 raises the ERR of net from 2.0 to 6.0 % (3 times as high). 1 of 2 disturbances "
            "raise it, 0 beyond chance.",
        ),
        (disturbed(0, 9), "fog:1 raises the ERR of net from 0.0 to 9.0 %."),
        (disturbed(2, 1.9), "No disturbance makes net worse."),
        (
            disturbed(2, 3, 3.2, p=0.001),
            "fog:2 raises the ERR of net from 2.0 to 3.2 % (1.6 times as high). "
            "2 of 2 disturbances raise it, 2 beyond chance.",
        ),
    ],
)
def test_what_harms_most_is_told_in_one_sentence(changes, sentence):
    assert describe_disturbances({"net": changes}, "net") == sentence
    assert describe_disturbances({"net": changes}, "masks") == sentence
    assert not describe_disturbances({}, "net")
