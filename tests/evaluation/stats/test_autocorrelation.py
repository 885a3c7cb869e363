"""The mean of a series whose neighbours resemble each other."""

import numpy as np
import pytest
from scipy import stats
from scipy.fft import dct
from scipy.linalg import toeplitz

from roadeval.evaluation.stats.autocorrelation import cosine_variances, mean_distribution
from tests.evaluation.making import autoregression

INDEPENDENT = np.random.default_rng(1).standard_normal(400)
BURSTS = np.maximum(INDEPENDENT - 1, 0)


def width(series: np.ndarray) -> float:
    low, high = mean_distribution(series).interval(0.95)
    return high - low


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.95, 0.999])
@pytest.mark.parametrize("n", [12, 61])
def test_variances_of_cosine_coefficients_and_of_the_mean_are_exact(rho: float, n: int) -> None:
    cosines = dct(np.eye(n), axis=0, norm="ortho")
    exact = np.diag(cosines @ toeplitz(rho ** np.arange(n)) @ cosines.T)
    assert cosine_variances(np.array([rho]), n, n)[0] == pytest.approx(exact, rel=1e-9)


def test_independent_frames_are_worth_about_as_many_and_give_students_interval() -> None:
    mean = mean_distribution(INDEPENDENT)
    low, high = stats.t.interval(0.95, 399, INDEPENDENT.mean(), stats.sem(INDEPENDENT))
    assert 250 < mean.effective <= 400
    assert mean.interval(0.95) == pytest.approx((low, high), abs=0.15 * (high - low))


def test_values_that_are_independent_by_design_have_students_interval_and_p_value() -> None:
    mean, student = mean_distribution(INDEPENDENT, independent=True), stats.ttest_1samp
    expected = student(INDEPENDENT, 0.1)
    assert mean.interval(0.9) == pytest.approx(tuple(expected.confidence_interval(0.9)))
    assert mean.p_value(0.1) == pytest.approx(expected.pvalue)


@pytest.mark.parametrize("rho", [0.5, 0.9])
def test_a_first_order_autoregression_is_worth_its_known_number_of_frames(rho: float) -> None:
    series = autoregression(np.random.default_rng(2), 20_000, rho)
    worth = 20_000 * (1 - rho) / (1 + rho)
    assert mean_distribution(series).effective == pytest.approx(worth, rel=0.3)


def test_frames_that_repeat_their_neighbour_tell_no_more_than_once() -> None:
    assert width(np.repeat(INDEPENDENT, 5)) == pytest.approx(width(INDEPENDENT), rel=0.2)


def test_a_slow_drift_below_noise_widens_the_interval() -> None:
    rng = np.random.default_rng(3)
    slow = autoregression(rng, 600, 0.98) + rng.standard_normal(600)
    assert width(slow) > 2 * width(rng.permutation(slow))


@pytest.mark.parametrize("series", [INDEPENDENT, BURSTS, INDEPENDENT.cumsum()])
@pytest.mark.parametrize("confidence", [0.8, 0.95, 0.999])
def test_the_ends_of_an_interval_are_the_means_that_the_p_value_just_allows(
    series: np.ndarray, confidence: float
) -> None:
    mean = mean_distribution(series)
    for end in mean.interval(confidence):
        assert mean.p_value(end) == pytest.approx(1 - confidence, rel=1e-6)
    assert mean.p_value(mean.mean) > 0.9


def test_an_interval_is_the_standard_error_times_students_quantile_but_for_skewness() -> None:
    mean = mean_distribution(autoregression(np.random.default_rng(4), 91, 0.8))
    half = stats.t.ppf(0.975, mean.degrees) * mean.standard_error
    expected = (mean.mean - half, mean.mean + half)
    assert mean._replace(skewness=0.0).interval(0.95) == pytest.approx(expected)
    assert mean.interval(0.95) == pytest.approx(expected, abs=0.1 * half)


def test_a_difference_beyond_doubt_has_a_p_value_that_says_so() -> None:
    rng = np.random.default_rng(5)
    p = [mean_distribution(1 + rng.standard_normal(60)).p_value() for _ in range(60)]
    assert np.mean(np.array(p) < 0.05 / 20) > 0.8


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_small_p_values_are_as_rare_as_they_say_where_nothing_differs(rho: float) -> None:
    rng = np.random.default_rng(6)
    p = np.array([mean_distribution(autoregression(rng, 91, rho)).p_value() for _ in range(500)])
    assert (p < 0.05).mean() < 0.07
    assert (p < 0.01).mean() < 0.02
    assert (p < 0.0025).sum() <= 5


def test_bursts_lengthen_the_interval_on_their_side() -> None:
    mean = mean_distribution(BURSTS)
    low, high = mean.interval(0.95)
    assert high - mean.mean > 1.2 * (mean.mean - low)
    assert mean_distribution(-BURSTS).interval(0.95) == pytest.approx((-high, -low))
