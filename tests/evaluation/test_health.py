"""When a frame is fine, and what is said of one that is not."""

import pytest

from roadeval.data import Counts, Health
from roadeval.evaluation import metrics
from roadeval.evaluation.health import Rates, judge, notes
from roadeval.evaluation.settings import EvaluationSettings

SETTINGS = EvaluationSettings(
    failed_err=0.25, failed_fnr=0.9, degraded_err=0.15, degraded_margin=0.02, noteworthy=0.05
)


def with_error(percent: int, road: int = 50) -> Rates:
    """Rates of a frame of 100 pixels, of which ``percent`` are called road wrongly."""
    return metrics.of(Counts(tp=road, tn=100 - road - percent, fp=percent, fn=0))


def test_few_errors_are_fine() -> None:
    assert judge(with_error(14), None, SETTINGS) is Health.OK


@pytest.mark.parametrize(("percent", "health"), [(15, Health.DEGRADED), (25, Health.FAILED)])
def test_many_errors_degrade_and_more_fail(percent: int, health: Health) -> None:
    assert judge(with_error(percent), None, SETTINGS) is health


def test_finding_next_to_no_road_fails_however_little_there_is() -> None:
    missed = metrics.of(Counts(tp=0, tn=95, fp=0, fn=5))
    assert judge(missed, None, SETTINGS) is Health.FAILED


def test_a_frame_without_road_fails_by_its_errors_only() -> None:
    assert judge(metrics.of(Counts(tn=100)), None, SETTINGS) is Health.OK
    assert judge(metrics.of(Counts(tn=70, fp=30)), None, SETTINGS) is Health.FAILED


@pytest.mark.parametrize(("blind", "health"), [(7, Health.OK), (5, Health.DEGRADED)])
def test_losing_to_blind_by_more_than_the_margin_degrades(blind: int, health: Health) -> None:
    assert judge(with_error(8), with_error(blind), SETTINGS) is health


def test_a_fine_frame_needs_no_note() -> None:
    finals = {"filtered": with_error(8), "unfiltered": with_error(9)}
    assert notes(finals, with_error(7), SETTINGS) == ()


@pytest.mark.parametrize(
    ("filtered", "unfiltered", "note"),
    [
        (20, 8, "The filter raised ERR by 12.0 pp on this frame."),
        (8, 20, "The filter lowered ERR by 12.0 pp on this frame."),
    ],
)
def test_a_large_effect_of_the_filter_is_noted(filtered: int, unfiltered: int, note: str) -> None:
    finals = {"filtered": with_error(filtered), "unfiltered": with_error(unfiltered)}
    assert notes(finals, None, SETTINGS) == (note,)


def test_a_failure_is_noted_with_its_reason() -> None:
    missed = metrics.of(Counts(tp=1, tn=80, fp=0, fn=19))
    assert notes({"net": missed}, None, SETTINGS) == ("net finds 5.0 % of the road.",)
    wrong = notes({"net": with_error(30)}, None, SETTINGS)
    assert wrong == ("net gets 30.0 % of the pixels wrong.",)


def test_losing_to_blind_is_noted() -> None:
    assert notes({"net": with_error(14)}, with_error(7), SETTINGS) == (
        "net is 7.0 pp worse than blind, which never looks at the image (ERR 7.0 %).",
    )
