"""What a difference tells: how sure it is, in words."""

import math
from dataclasses import replace

import pytest

from roadeval.evaluation.score import Effect
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import Difference
from roadeval.results.sentences import (
    NOTHING_SCORED,
    Degree,
    correction,
    degree,
    sentence,
    verdict,
)
from tests.evaluation.making import a_difference

SETTINGS = EvaluationSettings()
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
    ("found", "known", "told"),
    [
        (
            HARM,
            Degree.SURE,
            f"{HERE} raises ERR by 9.2 pp; on frames like these by 7.1 to 11.0 pp.",
        ),
        (
            a_difference(-1.4, -2.4, -0.8, units=91),
            Degree.SURE,
            f"{HERE} lowers ERR by 1.4 pp; on frames like these by 0.8 to 2.4 pp.",
        ),
        (
            a_difference(-3.3, -8, 1.4, p=0.15, units=91),
            Degree.PROBABLE,
            f"{HERE} lowers ERR by 3.3 pp; probably also on frames like these: between "
            "-8.0 and +1.4 pp.",
        ),
        (
            a_difference(0.2, -0.4, 0.95, p=0.5, units=91),
            Degree.LITTLE,
            f"{HERE} raises ERR by 0.20 pp; on frames like these by no more than 0.95 pp either "
            "way.",
        ),
        (
            UNSURE,
            Degree.UNKNOWN,
            f"{HERE} lowers ERR by 3.3 pp; on frames like these the effect is unclear: "
            "between -20.0 and +3.4 pp.",
        ),
        (
            a_difference(9.2, units=1, needed=10),
            Degree.FEW,
            "On this frame the filter raises ERR by 9.2 pp; 1 frame is too few for an interval "
            "(10 are needed).",
        ),
        (
            a_difference(0, 0, 0, p=1.0, units=91),
            Degree.SAME,
            f"{HERE} leaves ERR of every frame as it is.",
        ),
        (
            a_difference(math.nan),
            Degree.UNDEFINED,
            "Nothing to compare: ERR is undefined on every frame.",
        ),
        (
            OVER,
            Degree.SURE,
            "Over 8 drives the filter lowers ERR by 1.0 pp (worse on 1, better on 7); on drives "
            "like these by 0.4 to 2.0 pp.",
        ),
        (
            replace(OVER, groups=2, low=None, high=None, p=None, needed=6),
            Degree.FEW,
            "Over 8 drives in 2 groups the filter lowers ERR by 1.0 pp (worse on 1, better on 7); "
            "2 groups of drives are too few for an interval (6 are needed).",
        ),
    ],
)
def test_the_fact_is_told_first_and_then_what_it_says_of_others(found, known, told):
    assert degree(found, SETTINGS) is known
    assert sentence(found, "the filter", "ERR", SETTINGS) == told


def test_what_does_not_stand_after_correction_is_only_probable_and_the_family_is_named():
    corrected = replace(HARM, p_holm=0.06, comparisons=5)
    assert degree(corrected, SETTINGS) is Degree.PROBABLE
    told = sentence(corrected, "the filter", "ERR", SETTINGS)
    assert told.endswith("between +7.1 and +11.0 pp (corrected for 5 comparisons).")
    alone = replace(HARM, p_holm=0.001, comparisons=1)
    assert "corrected" not in sentence(alone, "the filter", "ERR", SETTINGS)


def test_what_is_negligible_is_a_setting():
    little = a_difference(0.2, -0.4, 0.95, p=0.5)
    assert degree(little, SETTINGS) is Degree.LITTLE
    assert degree(little, EvaluationSettings(negligible=0.005)) is Degree.UNKNOWN


@pytest.mark.parametrize(
    ("sizes", "told"),
    [
        ([], ""),
        ([None, None], ""),
        ([1], "* excludes 0; it is the only one, so nothing is corrected."),
        (
            [3, None, 3, 4],
            "* significant after Holm's correction for the differences of ERR of final masks "
            "against one base (3 and 4); others are not corrected.",
        ),
    ],
)
def test_the_mark_in_tables_is_explained_by_the_families(sizes, told):
    assert correction(replace(HARM, comparisons=size) for size in sizes) == told


# --- The verdict ----------------------------------------------------------------------------------

BLIND = "blind, which never looks at the image"


def against(base, **found):
    return [
        Effect(base, "post", variant, "post", True, {"ERR": difference})
        for variant, difference in found.items()
    ]


def a_verdict(effects, *variants):
    return verdict({name: {"post": {"ERR": 0.054}} for name in variants}, effects, SETTINGS)


def test_a_filter_is_held_against_none_and_against_the_baseline():
    effects = against("unfiltered", net=UNSURE, filtered=HARM)
    effects += against("blind", filtered=UNSURE, unfiltered=HARM)
    told = a_verdict(effects, "filtered", "unfiltered", "blind")
    assert told.startswith("On these 91 frames the filter raises ERR of post by 9.2 pp; ")
    assert f"On these 91 frames filtered instead of {BLIND}, lowers ERR of post by 3.3" in told
    assert "net" not in told


def test_without_a_filter_the_best_variant_is_held_against_the_baseline():
    effects = against("blind", net=HARM, unfiltered=replace(HARM, mean=0.08))
    told = a_verdict(effects, "net", "unfiltered", "blind")
    assert told.startswith(f"On these 91 frames unfiltered instead of {BLIND}, raises ERR of post")


def test_a_variant_without_masks_of_some_frames_is_not_called_the_best():
    effects = against("blind", half=replace(HARM, mean=-0.5, units=40), unfiltered=HARM)
    assert "unfiltered instead of blind" in a_verdict(effects, "half", "unfiltered", "blind")


def test_without_anything_to_compare_with_the_rates_are_told():
    assert a_verdict([], "net") == (
        "ERR is 5.4 % with net; no frame with truth was trained on, so blind is unknown."
    )
    assert verdict({}, [], SETTINGS) == NOTHING_SCORED
