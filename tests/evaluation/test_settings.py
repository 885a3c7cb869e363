"""The evaluation's settings as a summary states them."""

import pytest

from roadeval.errors import RoadevalError
from roadeval.evaluation.settings import EvaluationSettings, settings_of


def test_settings_of_another_version_are_read_as_far_as_they_are_known():
    evaluation = {"evaluation": {"window": 7, "from_the_future": 1}}
    assert settings_of({"run": evaluation}) == EvaluationSettings(window=7)
    assert settings_of({}) == EvaluationSettings()


@pytest.mark.parametrize("given", [{"confidence": 2}, {"window": None}, 5, None])
def test_damaged_settings_of_a_summary_are_told(given):
    with pytest.raises(RoadevalError, match=r"`run.evaluation` is not what it must be"):
        settings_of({"run": {"evaluation": given}})
