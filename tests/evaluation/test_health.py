"""When a frame is fine, degraded or failed."""

import pytest

from roadeval.data import Counts, Health
from roadeval.evaluation import metrics
from roadeval.evaluation.score import judge


def with_error(percent: int, road: int = 50) -> dict[str, float]:
    """Rates of a frame of 100 pixels, of which ``percent`` are called road wrongly."""
    return metrics.of(Counts(tp=road, tn=100 - road - percent, fp=percent, fn=0))


def test_few_errors_are_fine() -> None:
    assert judge(with_error(14), None) is Health.OK


@pytest.mark.parametrize(("percent", "health"), [(15, Health.DEGRADED), (25, Health.FAILED)])
def test_many_errors_degrade_and_more_fail(percent: int, health: Health) -> None:
    assert judge(with_error(percent), None) is health


def test_finding_next_to_no_road_fails_however_little_there_is() -> None:
    missed = metrics.of(Counts(tp=0, tn=95, fp=0, fn=5))
    assert judge(missed, None) is Health.FAILED


def test_a_frame_without_road_fails_by_its_errors_only() -> None:
    assert judge(metrics.of(Counts(tn=100)), None) is Health.OK
    assert judge(metrics.of(Counts(tn=70, fp=30)), None) is Health.FAILED


@pytest.mark.parametrize(("blind", "health"), [(7, Health.OK), (5, Health.DEGRADED)])
def test_losing_to_blind_by_more_than_the_margin_degrades(blind: int, health: Health) -> None:
    assert judge(with_error(8), with_error(blind)) is health
