"""How far drives lie from each other."""

import math

import numpy as np
import pytest
from scipy import optimize, stats
from statsmodels.stats.meta_analysis import combine_effects

from roadeval.evaluation.drives.effect import Clusters
from roadeval.evaluation.drives.settings import AcrossSettings
from roadeval.evaluation.drives.spread import Spread, spread_of, tau_squared
from tests.evaluation.drives.making import drives

SETTINGS = AcrossSettings()
RNG = np.random.default_rng(8)
ERRORS = RNG.uniform(0.005, 0.03, 12)
MEANS = 0.01 + 0.02 * RNG.standard_normal(12) + ERRORS * RNG.standard_normal(12)


def of(means, errors, groups=None) -> Spread:
    fleet = drives([float(each) for each in means], errors, groups)
    return spread_of(Clusters.of(fleet), SETTINGS)


def found() -> Spread:
    return of(MEANS, ERRORS.tolist())


def q(tau2: float, means=MEANS, errors=ERRORS) -> float:
    """Q, in a plain loop."""
    weights = [1 / (tau2 + error**2) for error in errors]
    middle = sum(w * y for w, y in zip(weights, means, strict=True)) / sum(weights)
    return sum(w * (y - middle) ** 2 for w, y in zip(weights, means, strict=True))


def test_the_spread_is_paule_and_mandel_s_of_statsmodels() -> None:
    expected = combine_effects(MEANS, ERRORS**2, method_re="iterated", atol=1e-12).tau2
    assert expected > 0
    assert found().tau ** 2 == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("farthest", [0.0, 0.08])
def test_the_interval_holds_the_spreads_at_which_q_is_no_rare_value(farthest: float) -> None:
    means = np.array([*MEANS[:11], MEANS[11] + farthest])
    spread = of(means, ERRORS.tolist())
    weights = 1 / (spread.tau**2 + ERRORS**2)
    z = (means - np.average(means, weights=weights)) * np.sqrt(weights)
    # Not centred once more: z has a weighted mean of 0.
    ratio = np.mean(z**4) / np.mean(z**2) ** 2
    excess = max(11 / (10 * 9) * (13 * (ratio - 3) + 6), 0)
    assert (excess > 0.5) == (farthest > 0)
    degrees = 11 / (1 + excess * 11 / 24)
    high, low = (11 / degrees * stats.chi2.ppf(level, degrees) for level in (0.025, 0.975))
    assert q(spread.tau_high**2, means) == pytest.approx(high)
    assert spread.tau_low == 0 or q(spread.tau_low**2, means) == pytest.approx(low)
    assert (spread.tau_low == 0) == (q(0, means) < low)


def test_normal_drives_have_the_plain_q_profile() -> None:
    means = stats.norm.ppf((np.arange(20) + 0.5) / 20)
    spread = of(means, 0.5)
    targets = stats.chi2.ppf([0.975, 0.025], 19)
    ends = [math.sqrt(means.var(ddof=1) * 19 / target - 0.25) for target in targets]
    assert (spread.tau_low, spread.tau_high) == pytest.approx(ends)


def test_drives_that_lie_far_off_widen_the_interval_of_the_spread() -> None:
    even = stats.norm.ppf((np.arange(20) + 0.5) / 20)
    heavy = stats.t.ppf((np.arange(20) + 0.5) / 20, 2)
    heavy *= even.std() / heavy.std()
    usual, wider = of(even, 0.1), of(heavy, 0.1)
    assert wider.tau == pytest.approx(usual.tau)
    assert wider.tau_low < usual.tau_low < usual.tau_high < wider.tau_high


def test_roots_of_several_fleets_and_targets_are_found_at_once() -> None:
    means, variances = np.stack([MEANS, 2 * MEANS]), np.stack([ERRORS**2, ERRORS**2])
    roots = tau_squared(means, variances, np.array([[5.0, 11.0], [11.0, 1e9]]))
    assert q(roots[0, 0]) == pytest.approx(5)
    assert q(roots[0, 1]) == pytest.approx(11)
    assert q(roots[1, 0], 2 * MEANS) == pytest.approx(11)
    assert roots[1, 1] == 0


def test_the_share_between_drives_is_higgins_and_thompson_s() -> None:
    weights = ERRORS**-2
    typical = 11 * weights.sum() / (weights.sum() ** 2 - (weights**2).sum())
    assert found().share == pytest.approx(found().tau ** 2 / (found().tau ** 2 + typical))


def test_a_new_drive_s_interval_is_that_of_the_mixture_over_the_spread() -> None:
    spread = found()
    error = MEANS.var(ddof=1) / 12
    # The spread's distribution once more, finer and by another solver.
    weights = 1 / (spread.tau**2 + ERRORS**2)
    z = (MEANS - np.average(MEANS, weights=weights)) * np.sqrt(weights)
    ratio = np.mean(z**4) / np.mean(z**2) ** 2
    degrees = 11 / (1 + max(11 / 90 * (13 * (ratio - 3) + 6), 0) * 11 / 24)
    scales = []
    for level in (np.arange(400) + 0.5) / 400:
        target = 11 / degrees * stats.chi2.ppf(level, degrees)
        root = 0.0 if q(0) < target else optimize.brentq(lambda t, k=target: q(t) - k, 0, 100)
        scales.append(math.sqrt(root + error))
    half = (spread.new_high - spread.new_low) / 2
    beyond = 2 * stats.t.sf(half / np.array(scales), 11).mean()
    assert (spread.new_low + spread.new_high) / 2 == pytest.approx(MEANS.mean())
    assert beyond == pytest.approx(0.05, abs=0.003)


def test_drives_that_differ_by_less_than_their_errors_have_no_spread() -> None:
    spread = of(MEANS / 100, ERRORS.tolist())
    assert (spread.tau, spread.tau_low, spread.share) == (0, 0, 0)
    assert spread.new_low < MEANS.mean() / 100 < spread.new_high


def test_drives_without_a_standard_error_are_left_out() -> None:
    spread = of([*MEANS, 5.0], [*ERRORS, None])
    assert spread == found()
    assert spread.drives == 12


def test_five_drives_have_no_spread() -> None:
    assert of(MEANS[:5], 0.01) is None
    assert of(MEANS[:6], 0.01) is not None


def test_drives_without_any_error_are_measured_exactly() -> None:
    spread = of(MEANS, 0.0)
    assert spread.tau == pytest.approx(MEANS.std(ddof=1))
    assert spread.share == pytest.approx(1)


def test_drives_that_are_all_alike_have_no_spread_at_all() -> None:
    spread = of(np.full(8, 0.125), 0.0)
    assert (spread.tau, spread.tau_high, spread.share) == (0, 0, 0)
    assert (spread.new_low, spread.new_high) == (0.125, 0.125)


def test_copies_of_drives_in_their_group_change_nothing() -> None:
    groups = [f"{place:02}" for place in range(12)]
    copied = of([*MEANS, *MEANS], [*ERRORS, *ERRORS], [*groups, *groups])
    alone = of(MEANS, ERRORS.tolist(), groups)
    assert (copied.tau, copied.tau_high) == pytest.approx((alone.tau, alone.tau_high))
    assert copied.new_high == pytest.approx(alone.new_high)
    assert (copied.drives, copied.clusters) == (24, 12)


def test_the_spread_of_groups_is_that_of_single_drives() -> None:
    rng = np.random.default_rng(9)
    group = np.repeat(np.arange(40), 5)
    means = rng.standard_normal(40)[group] + rng.standard_normal(200)
    spread = of(means, 0.1, [f"{each:02}" for each in group])
    assert spread.tau == pytest.approx(math.sqrt(2), rel=0.12)
    assert (spread.drives, spread.clusters) == (200, 40)
