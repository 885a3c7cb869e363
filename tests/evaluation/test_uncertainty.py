"""Differences between variants, and how sure they are."""

import math

import numpy as np
import pytest
from scipy import stats

from roadeval.evaluation.autocorrelation import error_of_mean
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import interval, mean_difference
from tests.evaluation.coverage import autoregression, simulate

SETTINGS = EvaluationSettings()
INDEPENDENT = np.random.default_rng(3).normal(0.01, 0.02, 200)


def test_the_mean_is_that_of_the_frames_that_have_a_difference() -> None:
    found = mean_difference(np.array([0.25, np.nan, 0.75]), SETTINGS)
    assert (found.mean, found.frames) == (0.5, 2)


def test_independent_frames_give_students_interval() -> None:
    found = mean_difference(INDEPENDENT, SETTINGS)
    low, high = stats.t.interval(0.95, 199, INDEPENDENT.mean(), stats.sem(INDEPENDENT))
    assert found.low == pytest.approx(low, abs=0.05 * (high - low))
    assert found.high == pytest.approx(high, abs=0.05 * (high - low))
    assert found.reason is None


def test_more_confidence_needs_a_wider_interval() -> None:
    usual = mean_difference(INDEPENDENT, SETTINGS)
    surer = mean_difference(INDEPENDENT, EvaluationSettings(confidence=0.99))
    assert surer.low < usual.low < usual.high < surer.high


def test_neighbours_that_resemble_each_other_widen_the_interval() -> None:
    once, thrice = (mean_difference(np.repeat(INDEPENDENT, k), SETTINGS) for k in (1, 3))
    assert thrice.mean == pytest.approx(once.mean)
    assert thrice.high - thrice.low == pytest.approx(once.high - once.low, rel=0.2)


def test_the_interval_is_students_of_the_error_and_its_degrees_of_freedom() -> None:
    error, found = error_of_mean(INDEPENDENT), interval(INDEPENDENT, SETTINGS)
    ends = stats.t.interval(0.95, error.degrees, INDEPENDENT.mean(), error.standard_error)
    assert (found.low, found.high) == pytest.approx(ends, rel=1e-12)


def test_a_handful_of_frames_gives_no_interval() -> None:
    found = mean_difference(INDEPENDENT[:9], SETTINGS)
    assert found.low is found.high is None
    assert found.reason == "there are 9 frames, and an interval needs 10"


def test_many_frames_that_are_worth_few_give_no_interval_either() -> None:
    found = mean_difference(autoregression(np.random.default_rng(4), 91, 0.95), SETTINGS)
    assert found.low is found.high is None
    assert found.effective_frames_low < 10
    assert found.reason.startswith("91 frames are worth about")


def test_no_frame_at_all_has_no_mean() -> None:
    found = mean_difference(np.array([np.nan, np.nan]), SETTINGS)
    assert math.isnan(found.mean)
    assert found.frames == 0
    assert found.low is None


@pytest.mark.parametrize("everywhere", [0.0, 0.25])
def test_the_same_difference_on_ten_frames_has_an_interval_without_width(
    everywhere: float,
) -> None:
    found = mean_difference(np.full(10, everywhere), SETTINGS)
    assert (found.mean, found.low, found.high) == (everywhere,) * 3
    assert found.reason == "the same on every frame"


@pytest.mark.parametrize("everywhere", [0.0, 0.25])
def test_the_same_difference_on_a_handful_of_frames_has_no_interval(everywhere: float) -> None:
    found = mean_difference(np.full(9, everywhere), SETTINGS)
    assert (found.mean, found.low, found.high) == (everywhere, None, None)
    assert found.reason == "there are 9 frames, and an interval needs 10"


def test_frames_mostly_without_a_difference_have_an_interval_all_the_same() -> None:
    found = mean_difference(np.r_[np.zeros(60), 0.1, np.zeros(30)], SETTINGS)
    assert found.low < found.mean < found.high


@pytest.mark.parametrize(("rho", "frames"), [(0.5, 91), (0.5, 500), (0.9, 500), (0.9, 2000)])
def test_given_intervals_hold_about_as_often_as_they_claim(rho: float, frames: int) -> None:
    found = simulate(rho, frames, 150, SETTINGS)
    assert found.withheld < 0.25
    assert abs(found.given - 0.95) < 0.08


def test_on_a_short_drive_of_like_frames_intervals_are_withheld() -> None:
    found = simulate(0.9, 91, 300, SETTINGS)
    assert found.withheld > 0.98
    assert found.naive < 0.5


def test_the_naive_interval_does_not_hold_on_autocorrelated_frames() -> None:
    assert simulate(0.9, 500, 150, SETTINGS).naive < 0.87
