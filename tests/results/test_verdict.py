"""The sentences at the top of the results."""

from dataclasses import replace

import pytest

from roadeval.evaluation.differences import DriveDifferences
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import Difference
from roadeval.results.verdict import NOTHING_SCORED, on_blind, on_filter, verdict_of

SETTINGS = EvaluationSettings()
BLIND = "blind, which never looks at the image"
HARM = Difference(0.092, 0.071, 0.11, 0.95, 0.001, 91, 30.0)
UNSURE = Difference(-0.033, -0.2, 0.034, 0.95, 0.4, 91, 4.0)


@pytest.mark.parametrize(
    ("found", "sentence"),
    [
        (HARM, "On this drive the filter raises ERR of post by 9.2 pp [7.1, 11.0]."),
        (
            Difference(-0.014, -0.024, -0.008, 0.95, 0.01, 91, 30.0),
            "On this drive the filter lowers ERR of post by 1.4 pp [0.8, 2.4].",
        ),
        (
            Difference(-0.033, -0.08, 0.014, 0.95, 0.15, 91, 30.0),
            "On this drive the filter probably lowers ERR of post, by 3.3 pp "
            "(between -8.0 and +1.4 pp).",
        ),
        (
            Difference(0.002, -0.004, 0.0095, 0.95, 0.5, 91, 30.0),
            "On this drive the filter has no effect on ERR of post larger than 0.95 pp.",
        ),
        (
            UNSURE,
            "Cannot tell whether the filter helps here: ERR of post changes by between -20.0 and "
            "+3.4 pp (-3.3 on these 91 frames).",
        ),
        (
            Difference(0.092, None, None, 0.95, None, 9, None),
            "Too few frames to tell whether the filter helps: ERR of post changes by +9.2 pp on "
            "these 9.",
        ),
        (
            Difference(0.0, 0.0, 0.0, 0.95, 1.0, 91, 91.0),
            "On this drive the filter leaves ERR of post of every frame as it is.",
        ),
        (
            Difference(float("nan"), None, None, 0.95, None, 0, None),
            "Nothing to compare: ERR of post is undefined on every frame.",
        ),
    ],
)
def test_the_verdict_on_a_filter_has_degrees(found: Difference, sentence: str) -> None:
    assert on_filter(found, "post", SETTINGS) == sentence


@pytest.mark.parametrize(
    ("found", "sentence"),
    [
        (HARM, f"net is worse than {BLIND}: its ERR is 9.2 pp higher [7.1, 11.0]."),
        (
            Difference(-0.033, -0.08, 0.014, 0.95, 0.15, 91, 30.0),
            f"net is probably better than {BLIND}: its ERR is 3.3 pp lower (between -8.0 and "
            "+1.4 pp).",
        ),
        (
            Difference(0.002, -0.004, 0.0095, 0.95, 0.5, 91, 30.0),
            f"net is as good as {BLIND}: its ERR is the same to within 0.95 pp.",
        ),
        (
            UNSURE,
            f"Cannot tell whether net beats {BLIND}: ERR changes by between -20.0 and +3.4 pp "
            "(-3.3 on these 91 frames).",
        ),
    ],
)
def test_the_verdict_against_the_baseline_has_degrees(found: Difference, sentence: str) -> None:
    assert on_blind(found, "net", SETTINGS) == sentence


def test_a_difference_that_does_not_stand_after_correction_is_only_probable() -> None:
    corrected = replace(HARM, p_holm=0.06, comparisons=5)
    assert "probably raises" in on_filter(corrected, "post", SETTINGS)


def test_what_is_negligible_is_a_setting() -> None:
    little = Difference(0.002, -0.004, 0.0095, 0.95, 0.5, 91, 30.0)
    strict = EvaluationSettings(negligible=0.005)
    assert on_filter(little, "post", strict).startswith("Cannot tell")


def a_verdict(differences: DriveDifferences, *variants: str) -> str:
    return verdict_of({name: {"post": {"ERR": 0.054}} for name in variants}, differences, SETTINGS)


def test_a_filter_is_held_against_none_and_against_the_baseline() -> None:
    against = {"filtered": {"ERR": UNSURE}, "unfiltered": {"ERR": HARM}}
    told = a_verdict(
        DriveDifferences({"post": {"ERR": HARM}}, against), "filtered", "unfiltered", "blind"
    )
    assert told.startswith("On this drive the filter raises ERR")
    assert f"Cannot tell whether filtered beats {BLIND}" in told


def test_without_a_filter_the_best_variant_is_held_against_the_baseline() -> None:
    against = {"net": {"ERR": HARM}, "unfiltered": {"ERR": replace(HARM, mean=0.08)}}
    told = a_verdict(DriveDifferences({}, against), "net", "unfiltered", "blind")
    assert told == f"unfiltered is worse than {BLIND}: its ERR is 8.0 pp higher [7.1, 11.0]."


def test_a_variant_without_masks_of_some_frames_is_not_called_the_best() -> None:
    few = replace(HARM, mean=-0.5, frames=40)
    against = {"half": {"ERR": few}, "unfiltered": {"ERR": HARM}}
    told = a_verdict(DriveDifferences({}, against), "half", "unfiltered", "blind")
    assert told.startswith("unfiltered is worse than blind")


def test_without_anything_to_compare_with_the_rates_are_told() -> None:
    assert a_verdict(DriveDifferences({}, {}), "net") == (
        "ERR is 5.4 % with net; no frame with truth was trained on, so blind is unknown."
    )
    assert verdict_of({}, DriveDifferences({}, {}), SETTINGS) == NOTHING_SCORED
