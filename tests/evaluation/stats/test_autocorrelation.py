"""The mean of a series whose neighbours resemble each other."""

import numpy as np
import pytest
from scipy import stats
from scipy.fft import dct
from scipy.linalg import toeplitz

from roadeval.evaluation.stats import autocorrelation, mean_distribution
from tests.evaluation.making import autoregression

INDEPENDENT = np.random.default_rng(1).standard_normal(400)
CONFIDENCE = 0.95


def width(series: np.ndarray) -> float:
    low, high = mean_distribution(series).interval(CONFIDENCE)
    return high - low


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.95, 0.999])
@pytest.mark.parametrize("n", [12, 61])
def test_variances_of_cosine_coefficients_and_of_the_mean_are_exact(rho: float, n: int) -> None:
    cosines = dct(np.eye(n), axis=0, norm="ortho")
    exact = np.diag(cosines @ toeplitz(rho ** np.arange(n)) @ cosines.T)
    numbers, coefficient = np.arange(1, n), np.array([rho])
    found = autocorrelation._cosine_variances(coefficient[:, None], numbers, n)[0]
    of_mean = autocorrelation._variance_of_mean(coefficient, np.array([1.0]), n)
    assert found == pytest.approx(exact[1:], rel=1e-9)
    assert of_mean[0] == pytest.approx(exact[0] / n, rel=1e-9)


def test_independent_frames_are_worth_about_as_many_and_give_students_interval() -> None:
    found = mean_distribution(INDEPENDENT)
    low, high = stats.t.interval(0.95, 399, INDEPENDENT.mean(), stats.sem(INDEPENDENT))
    assert 250 < found.frames <= 400
    assert found.interval(CONFIDENCE) == pytest.approx((low, high), abs=0.15 * (high - low))


@pytest.mark.parametrize("rho", [0.5, 0.9])
def test_a_first_order_autoregression_is_worth_its_known_number_of_frames(rho: float) -> None:
    series = autoregression(np.random.default_rng(2), 20_000, rho)
    worth = 20_000 * (1 - rho) / (1 + rho)
    assert mean_distribution(series).frames == pytest.approx(worth, rel=0.3)


def test_frames_that_repeat_their_neighbour_tell_no_more_than_once() -> None:
    assert width(np.repeat(INDEPENDENT, 5)) == pytest.approx(width(INDEPENDENT), rel=0.2)


def test_a_slow_drift_below_noise_widens_the_interval() -> None:
    rng = np.random.default_rng(3)
    slow = autoregression(rng, 600, 0.98) + rng.standard_normal(600)
    assert width(slow) > 2 * width(rng.permutation(slow))


@pytest.mark.parametrize("series", [INDEPENDENT, np.maximum(INDEPENDENT - 1, 0)])
def test_the_ends_of_an_interval_are_the_means_that_the_p_value_just_allows(
    series: np.ndarray,
) -> None:
    found = mean_distribution(series)
    for end in found.interval(CONFIDENCE):
        assert found.p_value(end) == pytest.approx(0.05, rel=1e-6)
    assert found.p_value(found.mean) > 0.9


def test_bursts_lengthen_the_interval_on_their_side() -> None:
    found = mean_distribution(np.maximum(INDEPENDENT - 1, 0))
    low, high = found.interval(CONFIDENCE)
    assert high - found.mean > 1.2 * (found.mean - low)
    mirrored = mean_distribution(-np.maximum(INDEPENDENT - 1, 0)).interval(CONFIDENCE)
    assert mirrored == pytest.approx((-high, -low))
