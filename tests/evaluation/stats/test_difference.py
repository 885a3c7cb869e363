"""Differences between masks, corrections of p-values, and means of series that remember."""

import math
from itertools import combinations, product

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from scipy.fft import dct
from scipy.linalg import toeplitz
from statsmodels.stats.multitest import multipletests

from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.autocorrelation import cosine_variances, mean_distribution
from roadeval.evaluation.stats.difference import (
    Difference,
    benjamini_hochberg,
    holm,
    interval,
    over_drives,
    sign_flip_interval,
    sign_flip_p,
    strata,
    within_drive,
)
from tests.evaluation.making import autoregression

SETTINGS = EvaluationSettings()
INDEPENDENT = np.random.default_rng(3).normal(0.01, 0.02, 200)


# --- Within a drive


def within(rates, base, settings=SETTINGS, rate="ERR") -> Difference:
    """The difference of a drive of one camera."""
    columns = {rate: rates, f"{rate}_base": base, "stamp_ns": np.arange(len(rates))}
    return within_drive(pd.DataFrame({**columns, "camera": "front"}), rate, settings)


def from_30_percent(differences: np.ndarray, settings=SETTINGS) -> Difference:
    base = np.full(len(differences), 0.3)
    return within(base + differences, base, settings)


def test_frames_are_counted_as_worse_and_better_by_the_rate_s_direction():
    base = np.full(12, 0.5)
    rates = base + np.array([0.1] * 7 + [-0.1] * 3 + [0.0, math.nan])
    lower = within(rates, base)
    assert (lower.worse, lower.better, lower.equal, lower.units) == (7, 3, 1, 11)
    assert lower.mean == pytest.approx((0.7 - 0.3) / 11)
    higher = within(rates, base, rate="ACC")
    assert (higher.worse, higher.better, higher.equal) == (3, 7, 1)


def test_an_interval_and_its_p_value_are_those_of_the_mean_s_distribution():
    mean, differences = mean_distribution(INDEPENDENT), from_30_percent(INDEPENDENT)
    for difference in (differences, interval(INDEPENDENT)):
        assert (difference.low, difference.high) == pytest.approx(mean.interval(0.95), rel=1e-6)
        assert difference.p == pytest.approx(mean.p_value(), rel=1e-6)
        assert difference.effective == pytest.approx(mean.effective)
        assert difference.standard_error == pytest.approx(mean.standard_error)
        assert difference.degrees == pytest.approx(mean.degrees)


def test_a_handful_of_frames_gives_no_interval():
    few = from_30_percent(INDEPENDENT[:9])
    assert few.low is few.high is few.p is few.effective is None
    assert few.none_because == "9 frames are too few for an interval (10 are needed)"
    assert from_30_percent(INDEPENDENT[:10]).low is not None
    assert from_30_percent(INDEPENDENT[:10], EvaluationSettings(least_frames=11)).low is None


def test_frames_that_are_all_alike_have_an_interval_of_everything_that_can_be():
    walk = from_30_percent(0.1 * np.random.default_rng(5).standard_normal(91).cumsum())
    assert (walk.low, walk.high) == (-0.3, 0.7)
    assert walk.p > 0.05
    assert walk.effective < 3


@pytest.mark.parametrize(("everywhere", "p"), [(0.0, 1.0), (0.25, 0.0)])
def test_the_same_difference_on_ten_frames_has_an_interval_without_width(everywhere, p):
    base = np.full(10, 0.5)
    same = within(base + everywhere, base)
    assert (same.mean, same.low, same.high, same.p) == (everywhere,) * 3 + (p,)
    assert (same.effective, same.standard_error) == (10, 0)


@pytest.mark.parametrize(("rho", "frames"), [(0.5, 91), (0.9, 60), (0.9, 91), (0.95, 190)])
def test_intervals_hold_about_as_often_as_they_claim(rho, frames):
    rng = np.random.default_rng(7)
    p = np.array([interval(autoregression(rng, frames, rho)).p for _ in range(150)])
    assert 0.9 <= (p >= 0.05).mean() <= 0.99


# --- Over drives


def drives(means, groups=None):
    """Drives ``000``, ``001`` ... with these means."""
    names = [f"{place:03}" for place in range(len(means))]
    return pd.DataFrame({"drive": names, "group": groups or names, "mean": means})


def normal(count, mean=0.01):
    return np.random.default_rng(count).normal(mean, 0.02, count).tolist()


def test_thirty_groups_have_student_s_interval_and_p_value():
    fleet, expected = over_drives(drives(normal(30)), 0.95), stats.ttest_1samp(normal(30), 0)
    assert (fleet.low, fleet.high) == pytest.approx(tuple(expected.confidence_interval()))
    assert fleet.p == pytest.approx(expected.pvalue)
    assert fleet.none_because == ""


def test_fewer_have_those_of_the_sign_flip_test():
    fleet, means = over_drives(drives(normal(29)), 0.95), np.array(normal(29))
    assert (fleet.low, fleet.high) == sign_flip_interval(means, 0.95)
    assert fleet.p == sign_flip_p(means)


@pytest.mark.parametrize(("confidence", "needed"), [(0.9, 6), (0.95, 6), (0.99, 8), (0.999, 11)])
def test_too_few_groups_for_the_confidence_have_a_mean_alone_and_the_reason(confidence, needed):
    few = over_drives(drives(normal(needed - 1)), confidence)
    assert few.mean == pytest.approx(np.mean(normal(needed - 1)))
    assert few.low is few.high is few.p is None
    reason = f"{needed - 1} drives are too few for an interval ({needed} are needed)"
    assert few.none_because == reason
    assert over_drives(drives(normal(needed)), confidence).p is not None


@pytest.mark.parametrize("means", [[], [math.nan, math.nan]])
def test_no_drive_at_all_has_no_mean(means):
    fleet = over_drives(drives(means), 0.95)
    assert math.isnan(fleet.mean)
    assert (fleet.none_because, fleet.units, fleet.groups) == ("undefined on every drive", 0, 0)


def test_a_drive_without_a_mean_is_left_out_and_the_order_is_free():
    first, last = drives([math.nan, *normal(8)]), drives([*normal(8), math.nan])
    assert over_drives(first[::-1], 0.95) == over_drives(last, 0.95)
    assert over_drives(first, 0.95).units == 8


def test_a_group_s_drives_are_averaged_first():
    groups = ["a", "a", "a", "b", "c", "d", "e", "f"]
    fleet = over_drives(drives([0.1, 0.2, 0.6, 0.1, 0.2, 0.3, 0.4, 0.5], groups=groups), 0.95)
    alone = over_drives(drives([0.3, 0.1, 0.2, 0.3, 0.4, 0.5]), 0.95)
    assert (fleet.mean, fleet.low, fleet.high, fleet.p) == pytest.approx(
        (alone.mean, alone.low, alone.high, alone.p)
    )
    assert (fleet.units, fleet.groups, alone.groups) == (8, 6, 6)


def test_drives_are_counted_by_the_direction_in_which_they_changed():
    means = drives([0.1, 0.2, 0.3, -0.1, 0.0, 0.0])
    lower = over_drives(means, 0.95)
    assert (lower.worse, lower.better, lower.equal) == (3, 1, 2)
    higher = over_drives(means, 0.95, "ACC")
    assert (higher.worse, higher.better, higher.equal) == (1, 3, 2)


@pytest.mark.parametrize("unit", ["frames", "drives"])
@pytest.mark.parametrize("count", [12, 29, 30, 60])
def test_the_interval_leaves_out_0_exactly_where_the_p_value_is_small(count, unit):
    apart = 0
    for shift in np.linspace(0, 0.08, 15):
        difference = interval(np.array(normal(count, -0.01)) + shift, 0.95, unit)
        assert (difference.low > 0 or difference.high < 0) == (difference.p < 0.05)
        apart += difference.low > 0
    assert 0 < apart < 15


@pytest.mark.parametrize(("kind", "count"), [("normal", 8), ("t3", 8), ("normal", 40)])
def test_intervals_of_drives_hold_about_as_often_as_they_claim(kind, count):
    rng = np.random.default_rng(7)
    held = []
    for _ in range(150):
        effects = rng.standard_normal(count) if kind == "normal" else rng.standard_t(3, count)
        fleet = interval(effects, 0.95, "drives")
        held.append(fleet.low <= 0 <= fleet.high)
    assert 0.9 <= np.mean(held) <= 0.99


# --- The exact sign-flip test

TIES = np.array([0.1, 0.2, -0.3, 0.3, 0.0, 0.1, 0.2, -0.1])
NORMAL = np.random.default_rng(4).normal(0.4, 1.0, 24)


def values(count) -> np.ndarray:
    return np.random.default_rng(count).normal(0.3, 1.0, count)


@pytest.mark.parametrize("differences", [values(6), values(9), values(12), TIES])
def test_the_p_value_is_that_of_scipy_s_permutation_test(differences):
    expected = stats.permutation_test(
        (differences,), np.mean, permutation_type="samples", n_resamples=np.inf
    )
    assert sign_flip_p(differences) == expected.pvalue


@pytest.mark.parametrize("mean", [-0.2, 0.0, 0.1, 0.45])
def test_the_p_value_is_the_share_of_sign_patterns_at_least_as_far_off(mean):
    away = values(7) - mean
    sums = np.abs(np.array([*product([1, -1], repeat=7)]) @ away)
    assert sign_flip_p(values(7), mean) == np.mean(sums >= abs(away.sum()) - 1e-12)


def test_the_p_value_of_many_values_is_that_of_very_many_random_signs():
    sums = np.random.default_rng(5).choice([-1.0, 1.0], (50_000, 24)) @ NORMAL
    expected = np.mean(np.abs(sums) >= abs(NORMAL.sum()))
    assert sign_flip_p(NORMAL) == pytest.approx(expected, abs=4 * (expected / 50_000) ** 0.5)


@pytest.mark.parametrize("count", [6, 9, 11])
def test_the_interval_ends_at_ordered_means_of_subsets(count):
    subsets = (c for size in range(1, count + 1) for c in combinations(values(count), size))
    means = sorted(map(np.mean, subsets))
    # The empty set is the other one that counts.
    place = int(np.ceil(0.025 * 2**count)) - 1
    expected = means[place - 1], means[-place]
    assert sign_flip_interval(values(count), 0.95) == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
def test_the_sign_flip_interval_of_ties_leaves_out_0_where_the_p_value_is_small(confidence):
    rng, apart = np.random.default_rng(6), 0
    for _ in range(40):
        ties = rng.integers(-4, 8, rng.integers(8, 12)) / 10
        low, high = sign_flip_interval(ties, confidence)
        assert (low > 0 or high < 0) == (sign_flip_p(ties) < 1 - confidence)
        apart += low > 0
    assert 0 < apart < 40


def test_every_mean_in_the_interval_is_accepted_and_none_outside():
    low, high = sign_flip_interval(NORMAL, 0.95)
    width = high - low
    assert all(sign_flip_p(NORMAL, end) >= 0.05 for end in (low + 1e-6, high - 1e-6))
    assert all(sign_flip_p(NORMAL, end) < 0.05 for end in (low - width / 50, high + width / 50))


# --- Parts of a fleet

FLEET = drives(np.random.default_rng(3).normal(0.01, 0.02, 24).tolist())
LIGHT = ["dusk", "day", "night"] * 8


def parts(tags, fleet=FLEET):
    return [*strata(fleet.assign(**tags), [*tags], 0.95)]


def test_drives_are_divided_by_each_value_of_a_tag_that_they_have():
    by_light = parts({"light": LIGHT})
    assert [part[:2] for part in by_light] == [("light", at) for at in ("day", "dusk", "night")]
    assert [difference for *_, difference in by_light] == holm(
        [over_drives(FLEET[start::3], 0.95) for start in (1, 0, 2)]
    )
    both = parts({"light": [None, *LIGHT[1:]], "place": ["city", "country"] * 12})
    units = {tag: sum(d.units for by, _, d in both if by == tag) for tag in ("light", "place")}
    assert units == {"light": 23, "place": 24}


def test_what_does_not_divide_the_drives_makes_no_parts():
    assert parts({"light": ["day"] * 24}) == []
    assert parts({"light": [None] * 24}) == []
    assert [value for _, value, _ in parts({"light": ["day"] * 23 + [None]})] == ["day"]
    assert parts({"light": []}, fleet=drives([])) == []


def test_p_values_are_corrected_for_all_parts_together_in_which_something_can_be_found():
    tested = [part for *_, part in parts({"light": LIGHT, "place": ["city", "country"] * 12})]
    expected = multipletests([difference.p for difference in tested], method="holm")[1]
    assert [difference.p_holm for difference in tested] == pytest.approx(expected.tolist())
    assert {difference.comparisons for difference in tested} == {5}
    weather = ["fog"] * 2 + ["rain"] * 10 + ["sun"] * 12
    fog, rain, sun = (
        d for *_, d in parts({"weather": weather}, pd.concat([FLEET[:12], drives([0.0] * 12)]))
    )
    assert fog.p is fog.p_holm is sun.p_holm is sun.comparisons is None
    assert (rain.p_holm, rain.comparisons) == (rain.p, 1)


# --- Corrections of p-values


def _holm(values):
    """Holm's correction of differences with these p-values."""
    family = [Difference(0.1, -0.1, 0.2, p, 0.95, "drives", 9) for p in values]
    return [difference.p_holm for difference in holm(family)]


@pytest.mark.parametrize(("correct", "name"), [(_holm, "holm"), (benjamini_hochberg, "fdr_bh")])
def test_a_correction_is_that_of_statsmodels_and_counts_only_what_was_tested(correct, name):
    p = [0.03, 0.001, 0.2, 0.04, 0.011, 0.04, 0.9]
    expected = multipletests(p, method=name)[1].tolist()
    assert correct(p) == pytest.approx(expected)
    assert correct([None, *p, None]) == [None, *correct(p), None]
    assert correct([None]) == [None]
    assert correct([]) == []


def test_of_drives_that_seem_to_differ_about_as_few_as_are_allowed_do_not():
    rng, false = np.random.default_rng(2), []
    for _ in range(200):
        # Half of 40 drives differ, so that half of the tenth that is allowed is false.
        p = [*rng.uniform(size=20), *(rng.uniform(size=20) / 500)]
        significant = np.array(benjamini_hochberg(p)) <= 0.1
        false.append(significant[:20].sum() / max(significant.sum(), 1))
    assert np.mean(false) == pytest.approx(0.05, abs=0.015)


STANDARD = np.random.default_rng(1).standard_normal(400)
BURSTS = np.maximum(STANDARD - 1, 0)


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
    mean = mean_distribution(STANDARD)
    low, high = stats.t.interval(0.95, 399, STANDARD.mean(), stats.sem(STANDARD))
    assert 250 < mean.effective <= 400
    assert mean.interval(0.95) == pytest.approx((low, high), abs=0.15 * (high - low))


def test_values_that_are_independent_by_design_have_students_interval_and_p_value() -> None:
    mean, student = mean_distribution(STANDARD, independent=True), stats.ttest_1samp
    expected = student(STANDARD, 0.1)
    assert mean.interval(0.9) == pytest.approx(tuple(expected.confidence_interval(0.9)))
    assert mean.p_value(0.1) == pytest.approx(expected.pvalue)


@pytest.mark.parametrize("rho", [0.5, 0.9])
def test_a_first_order_autoregression_is_worth_its_known_number_of_frames(rho: float) -> None:
    series = autoregression(np.random.default_rng(2), 20_000, rho)
    worth = 20_000 * (1 - rho) / (1 + rho)
    assert mean_distribution(series).effective == pytest.approx(worth, rel=0.3)


def test_frames_that_repeat_their_neighbour_tell_no_more_than_once() -> None:
    assert width(np.repeat(STANDARD, 5)) == pytest.approx(width(STANDARD), rel=0.2)


def test_a_slow_drift_below_noise_widens_the_interval() -> None:
    rng = np.random.default_rng(3)
    slow = autoregression(rng, 600, 0.98) + rng.standard_normal(600)
    assert width(slow) > 2 * width(rng.permutation(slow))


@pytest.mark.parametrize("series", [STANDARD, BURSTS, STANDARD.cumsum()])
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
