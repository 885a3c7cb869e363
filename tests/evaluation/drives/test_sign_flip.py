"""The exact sign-flip test and its interval."""

from itertools import combinations, product

import numpy as np
import pytest
from scipy import stats

from roadeval.evaluation.drives.sign_flip import (
    sign_flip_can_tell,
    sign_flip_interval,
    sign_flip_p,
)

TIES = [0.1, 0.2, -0.3, 0.3, 0.0, 0.1, 0.2, -0.1]
NORMAL = np.random.default_rng(4).normal(0.4, 1.0, 24)


def values(count: int) -> np.ndarray:
    return np.random.default_rng(count).normal(0.3, 1.0, count)


@pytest.mark.parametrize("of", [values(6), values(9), values(12), np.array(TIES)])
def test_the_p_value_is_that_of_scipy_s_permutation_test(of: np.ndarray) -> None:
    expected = stats.permutation_test(
        (of,), np.mean, permutation_type="samples", n_resamples=np.inf
    )
    assert sign_flip_p(of) == expected.pvalue


@pytest.mark.parametrize("mean", [-0.2, 0.0, 0.1, 0.45])
def test_the_p_value_is_the_share_of_sign_patterns_at_least_as_far_off(mean: float) -> None:
    away = values(7) - mean
    sums = [abs(np.dot(signs, away)) for signs in product([1, -1], repeat=7)]
    expected = np.mean([each >= abs(away.sum()) - 1e-12 for each in sums])
    assert sign_flip_p(values(7), mean) == expected


def test_the_p_value_of_many_values_is_that_of_very_many_random_signs() -> None:
    rng = np.random.default_rng(5)
    sums = rng.choice([-1.0, 1.0], (50_000, 24)) @ NORMAL
    expected = np.mean(np.abs(sums) >= abs(NORMAL.sum()))
    assert sign_flip_p(NORMAL) == pytest.approx(expected, abs=4 * (expected / 50_000) ** 0.5)


@pytest.mark.parametrize("count", [6, 9, 11])
def test_the_interval_ends_at_ordered_means_of_subsets(count: int) -> None:
    of = values(count)
    means = sorted(
        np.mean(subset) for size in range(1, count + 1) for subset in combinations(of, size)
    )
    # The empty set is the other one that counts.
    place = int(np.ceil(0.025 * 2**count)) - 1
    expected = means[place - 1], means[-place]
    assert sign_flip_interval(of, 0.95) == pytest.approx(expected, abs=1e-7)


def test_the_interval_of_six_values_reaches_from_the_least_to_the_greatest() -> None:
    of = values(6)
    assert sign_flip_interval(of, 0.95) == (of.min(), of.max())


@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
def test_the_interval_leaves_out_0_exactly_where_the_p_value_is_small(confidence: float) -> None:
    rng, apart = np.random.default_rng(6), 0
    for _ in range(40):
        of = rng.integers(-4, 8, rng.integers(8, 12)) / 10
        low, high = sign_flip_interval(of, confidence)
        assert (low > 0 or high < 0) == (sign_flip_p(of) < 1 - confidence)
        apart += low > 0
    assert 0 < apart < 40


def test_every_mean_in_the_interval_is_accepted_and_none_outside() -> None:
    low, high = sign_flip_interval(NORMAL, 0.95)
    width = high - low
    assert all(sign_flip_p(NORMAL, end) >= 0.05 for end in (low + 1e-6, high - 1e-6))
    assert all(sign_flip_p(NORMAL, end) < 0.05 for end in (low - width / 50, high + width / 50))


@pytest.mark.parametrize(("everywhere", "p"), [(0.25, 2**-7), (-0.25, 2**-7), (0.0, 1.0)])
def test_eight_equal_values_have_an_interval_without_width(everywhere: float, p: float) -> None:
    of = np.full(8, everywhere)
    assert sign_flip_interval(of, 0.95) == (everywhere, everywhere)
    assert sign_flip_p(of) == p


def test_five_values_cannot_tell_at_95_percent() -> None:
    assert not sign_flip_can_tell(5, 0.95)
    assert sign_flip_can_tell(6, 0.95)
    assert sign_flip_interval(values(5), 0.95) == (-np.inf, np.inf)
    assert not sign_flip_can_tell(7, 0.99)
    assert sign_flip_can_tell(8, 0.99)
