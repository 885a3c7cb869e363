"""Differences between masks, and how sure they are."""

import math

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.multitest import multipletests

from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import (
    CameraRates,
    Difference,
    benjamini_hochberg,
    holm,
    mean_distribution,
    within_drive,
)
from tests.evaluation.making import autoregression

SETTINGS = EvaluationSettings()
INDEPENDENT = np.random.default_rng(3).normal(0.01, 0.02, 200)


def within(rates, base, settings=SETTINGS, **known) -> Difference:
    """The difference of a drive of one camera."""
    return within_drive([CameraRates(np.arange(len(rates)), rates, base)], settings, **known)


def of(differences: np.ndarray, settings: EvaluationSettings = SETTINGS) -> Difference:
    """The mean of differences from a rate of 30 %."""
    base = np.full(len(differences), 0.3)
    return within(base + differences, base, settings)


def test_frames_are_counted_as_worse_and_better_by_the_rate_s_direction():
    base = np.full(12, 0.5)
    rates = base + np.array([0.1] * 7 + [-0.1] * 3 + [0.0, math.nan])
    lower = within(rates, base, SETTINGS)
    assert (lower.worse, lower.better, lower.equal, lower.units) == (7, 3, 1, 11)
    higher = within(rates, base, SETTINGS, higher_is_better=True)
    assert (higher.worse, higher.better, higher.equal) == (3, 7, 1)


def test_the_mean_is_that_of_the_frames_that_have_a_difference() -> None:
    found = within(np.array([0.25, np.nan, 0.75]), np.array([0.0, 0.5, 0.0]), SETTINGS)
    assert (found.mean, found.units) == (0.5, 2)


def test_independent_frames_give_about_students_interval() -> None:
    found = of(INDEPENDENT)
    low, high = stats.t.interval(0.95, 199, INDEPENDENT.mean(), stats.sem(INDEPENDENT))
    assert (found.low, found.high) == pytest.approx((low, high), abs=0.1 * (high - low))


def test_an_interval_and_its_p_value_are_those_of_the_mean_s_distribution() -> None:
    found, known = of(INDEPENDENT), mean_distribution(INDEPENDENT)
    assert (found.low, found.high) == pytest.approx(known.interval(0.95), rel=1e-6)
    assert found.p == pytest.approx(known.p_value(), rel=1e-6)
    assert found.effective == pytest.approx(known.frames)


def test_a_handful_of_frames_gives_no_interval() -> None:
    found = of(INDEPENDENT[:9])
    assert found.low is found.high is found.p is found.effective is None
    assert found.none_because == "9 frames are too few for an interval (10 are needed)"
    assert of(INDEPENDENT[:10]).low is not None
    assert of(INDEPENDENT[:10], EvaluationSettings(least_frames=11)).low is None


def test_frames_that_are_all_alike_have_an_interval_of_everything_that_can_be() -> None:
    found = of(0.1 * np.random.default_rng(5).standard_normal(91).cumsum())
    assert (found.low, found.high) == (-0.3, 0.7)
    assert found.p > 0.05
    assert found.effective < 3


@pytest.mark.parametrize(("everywhere", "p"), [(0.0, 1.0), (0.25, 0.0)])
def test_the_same_difference_on_ten_frames_has_an_interval_without_width(
    everywhere: float, p: float
) -> None:
    base = np.full(10, 0.5)
    found = within(base + everywhere, base, SETTINGS)
    assert (found.mean, found.low, found.high, found.p) == (everywhere,) * 3 + (p,)


@pytest.mark.parametrize(("rho", "frames"), [(0.5, 91), (0.9, 60), (0.9, 91), (0.95, 190)])
def test_intervals_hold_about_as_often_as_they_claim(rho: float, frames: int) -> None:
    rng = np.random.default_rng(7)
    drives = [mean_distribution(autoregression(rng, frames, rho)) for _ in range(150)]
    held = np.mean([drive.p_value() >= 0.05 for drive in drives])
    assert 0.9 <= held <= 0.99


# --- Corrections of p-values


def _holm(values):
    """Holm's correction of differences with these p-values."""
    family = [Difference(0.1, -0.1, 0.2, p, 0.95, "drives", 9) for p in values]
    return [each.p_holm for each in holm(family)]


VALUES = [0.03, 0.001, 0.2, 0.04, 0.011, 0.04, 0.9]


@pytest.mark.parametrize(("correct", "name"), [(_holm, "holm"), (benjamini_hochberg, "fdr_bh")])
def test_a_correction_is_that_of_statsmodels(correct, name: str) -> None:
    expected = multipletests(VALUES, method=name)[1].tolist()
    assert correct(VALUES) == pytest.approx(expected)


@pytest.mark.parametrize("correct", [_holm, benjamini_hochberg])
def test_what_was_not_tested_is_not_counted_and_stays_so(correct) -> None:
    tested = correct([0.01, 0.02])
    assert correct([0.01, None, 0.02, None]) == [tested[0], None, tested[1], None]
    assert correct([None]) == [None]
    assert correct([]) == []


def test_of_drives_that_seem_to_differ_about_as_few_as_asked_for_do_not() -> None:
    rng, false = np.random.default_rng(2), []
    for _ in range(200):
        # Half of 40 drives differ, so that half of the tenth that is allowed is false.
        values = [*rng.uniform(size=20), *(rng.uniform(size=20) / 500)]
        found = np.array(benjamini_hochberg(values)) <= 0.1
        false.append(found[:20].sum() / max(found.sum(), 1))
    assert np.mean(false) == pytest.approx(0.05, abs=0.015)
