"""What neighbouring frames are worth."""

import numpy as np
import pytest
from scipy import stats
from statsmodels.tsa.stattools import acovf

from roadeval.evaluation.autocorrelation import autocovariance, error_of_mean
from tests.evaluation.coverage import autoregression

RNG = np.random.default_rng(1)
INDEPENDENT = RNG.standard_normal(400)


@pytest.mark.parametrize("length", [4, 91, 100])
def test_autocovariances_equal_statsmodels(length: int) -> None:
    series = INDEPENDENT[:length]
    expected = acovf(series, adjusted=False, fft=False)
    assert autocovariance(series) == pytest.approx(expected, abs=1e-12)


def test_independent_frames_count_in_full() -> None:
    error = error_of_mean(INDEPENDENT)
    assert error.frames == pytest.approx(400, rel=0.05)
    assert error.standard_error == pytest.approx(stats.sem(INDEPENDENT), rel=0.05)


def test_frames_that_repeat_their_neighbour_count_once() -> None:
    rng = np.random.default_rng(2)
    errors = [error_of_mean(np.repeat(rng.standard_normal(400), 5)) for _ in range(40)]
    assert np.mean([error.frames for error in errors]) == pytest.approx(400, rel=0.1)
    assert np.mean([error.standard_error for error in errors]) == pytest.approx(1 / 20, rel=0.05)


@pytest.mark.parametrize("rho", [0.5, 0.9])
def test_a_first_order_autoregression_is_worth_its_known_number_of_frames(rho: float) -> None:
    series = autoregression(np.random.default_rng(2), 20_000, rho)
    error = error_of_mean(series)
    assert error.frames == pytest.approx(20_000 * (1 - rho) / (1 + rho), rel=0.15)
    assert error.standard_error == pytest.approx(error.frames**-0.5, rel=0.1)


@pytest.mark.parametrize("series", [INDEPENDENT, np.tile([1.0, -1.0], 50), np.arange(50.0)])
def test_no_series_is_worth_more_than_its_frames(series: np.ndarray) -> None:
    error = error_of_mean(series)
    assert 0 < error.frames_low <= error.frames <= len(series)


def test_a_drift_is_worth_next_to_nothing() -> None:
    assert error_of_mean(np.arange(91.0)).frames_low == 1
