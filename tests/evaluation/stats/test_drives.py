"""Differences over drives: the exact sign-flip test, Student's, groups of drives and parts."""

import math
from itertools import combinations, product

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.multitest import multipletests

from roadeval.evaluation.stats import (
    DriveMean,
    holm,
    over_drives,
    sign_flip_interval,
    sign_flip_p,
    strata,
)


def drives(means, groups=None):
    """Drives ``000``, ``001`` ... with these means."""
    names = [f"{place:03}" for place in range(len(means))]
    return [DriveMean(*own) for own in zip(names, groups or names, means, strict=True)]


def normal(count, mean=0.01):
    return np.random.default_rng(count).normal(mean, 0.02, count).tolist()


def test_thirty_clusters_have_student_s_interval_and_p_value():
    found, expected = over_drives(drives(normal(30)), 0.95), stats.ttest_1samp(normal(30), 0)
    assert (found.low, found.high) == pytest.approx(tuple(expected.confidence_interval()))
    assert found.p == pytest.approx(expected.pvalue)
    assert found.none_because == ""


def test_fewer_have_those_of_the_sign_flip_test():
    found, of = over_drives(drives(normal(29)), 0.95), np.array(normal(29))
    assert (found.low, found.high) == sign_flip_interval(of, 0.95)
    assert found.p == sign_flip_p(of)


def test_five_clusters_have_a_mean_alone_and_the_reason_is_told():
    found = over_drives(drives(normal(5)), 0.95)
    assert found.mean == pytest.approx(np.mean(normal(5)))
    assert found.low is found.high is found.p is None
    assert found.none_because == "5 drives are too few for an interval (6 are needed)"


@pytest.mark.parametrize(("confidence", "needed"), [(0.9, 6), (0.95, 6), (0.99, 8), (0.999, 11)])
def test_more_confidence_needs_more_clusters(confidence, needed):
    too_few = over_drives(drives(normal(needed - 1)), confidence)
    assert (too_few.needed, too_few.p) == (needed, None)
    assert over_drives(drives(normal(needed)), confidence).p is not None


@pytest.mark.parametrize("means", [[], [math.nan, math.nan]])
def test_no_drive_at_all_has_no_mean(means):
    found = over_drives(drives(means), 0.95)
    assert math.isnan(found.mean)
    assert (found.none_because, found.units, found.groups) == ("undefined on every drive", 0, 0)


def test_a_drive_without_a_mean_is_left_out():
    assert over_drives(drives([math.nan, *normal(8)]), 0.95) == over_drives(
        drives([*normal(8), math.nan]), 0.95
    )
    assert over_drives(drives([*normal(8), math.nan]), 0.95).units == 8


def test_a_group_s_drives_are_averaged_first():
    groups = ["a", "a", "a", "b", "c", "d", "e", "f"]
    found = over_drives(drives([0.1, 0.2, 0.6, 0.1, 0.2, 0.3, 0.4, 0.5], groups=groups), 0.95)
    alone = over_drives(drives([0.3, 0.1, 0.2, 0.3, 0.4, 0.5]), 0.95)
    assert (found.mean, found.low, found.high, found.p) == pytest.approx(
        (alone.mean, alone.low, alone.high, alone.p)
    )
    assert (found.units, found.groups, alone.groups) == (8, 6, 6)


def test_drives_are_counted_by_the_direction_in_which_they_changed():
    fleet = drives([0.1, 0.2, 0.3, -0.1, 0.0, 0.0])
    found = over_drives(fleet, 0.95)
    assert (found.worse, found.better, found.equal) == (3, 1, 2)
    other = over_drives(fleet, 0.95, higher_is_better=True)
    assert (other.worse, other.better, other.equal) == (1, 3, 2)


@pytest.mark.parametrize("count", [8, 12, 29, 30, 60])
def test_the_interval_leaves_out_0_exactly_where_the_p_value_is_small(count):
    apart = 0
    for shift in np.linspace(0, 0.08, 15):
        found = over_drives(drives([each + shift for each in normal(count, -0.01)]), 0.95)
        assert (found.low > 0 or found.high < 0) == (found.p < 0.05)
        apart += found.low > 0
    assert 0 < apart < 15


@pytest.mark.parametrize(("kind", "count"), [("normal", 8), ("t3", 8), ("normal", 40)])
def test_intervals_hold_about_as_often_as_they_claim(kind, count):
    rng = np.random.default_rng(7)
    held = []
    for _ in range(150):
        effects = rng.standard_normal(count) if kind == "normal" else rng.standard_t(3, count)
        found = over_drives(drives(effects.tolist()), 0.95)
        held.append(found.low <= 0 <= found.high)
    assert 0.9 <= np.mean(held) <= 0.99


# --- The exact sign-flip test

TIES = [0.1, 0.2, -0.3, 0.3, 0.0, 0.1, 0.2, -0.1]
NORMAL = np.random.default_rng(4).normal(0.4, 1.0, 24)


def values(count) -> np.ndarray:
    return np.random.default_rng(count).normal(0.3, 1.0, count)


@pytest.mark.parametrize("of", [values(6), values(9), values(12), np.array(TIES)])
def test_the_p_value_is_that_of_scipy_s_permutation_test(of):
    expected = stats.permutation_test(
        (of,), np.mean, permutation_type="samples", n_resamples=np.inf
    )
    assert sign_flip_p(of) == expected.pvalue


@pytest.mark.parametrize("mean", [-0.2, 0.0, 0.1, 0.45])
def test_the_p_value_is_the_share_of_sign_patterns_at_least_as_far_off(mean):
    away = values(7) - mean
    sums = [abs(np.dot(signs, away)) for signs in product([1, -1], repeat=7)]
    expected = np.mean([each >= abs(away.sum()) - 1e-12 for each in sums])
    assert sign_flip_p(values(7), mean) == expected


def test_the_p_value_of_many_values_is_that_of_very_many_random_signs():
    rng = np.random.default_rng(5)
    sums = rng.choice([-1.0, 1.0], (50_000, 24)) @ NORMAL
    expected = np.mean(np.abs(sums) >= abs(NORMAL.sum()))
    assert sign_flip_p(NORMAL) == pytest.approx(expected, abs=4 * (expected / 50_000) ** 0.5)


@pytest.mark.parametrize("count", [6, 9, 11])
def test_the_interval_ends_at_ordered_means_of_subsets(count):
    of = values(count)
    means = sorted(
        np.mean(subset) for size in range(1, count + 1) for subset in combinations(of, size)
    )
    # The empty set is the other one that counts.
    place = int(np.ceil(0.025 * 2**count)) - 1
    expected = means[place - 1], means[-place]
    assert sign_flip_interval(of, 0.95) == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
def test_the_sign_flip_interval_leaves_out_0_exactly_where_the_p_value_is_small(confidence):
    rng, apart = np.random.default_rng(6), 0
    for _ in range(40):
        of = rng.integers(-4, 8, rng.integers(8, 12)) / 10
        low, high = sign_flip_interval(of, confidence)
        assert (low > 0 or high < 0) == (sign_flip_p(of) < 1 - confidence)
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
    return [*strata(fleet, tags, 0.95)]


def test_each_value_of_a_tag_is_summed_up_by_itself():
    found = parts({"light": LIGHT})
    assert [part[:2] for part in found] == [("light", own) for own in ("day", "dusk", "night")]
    assert [difference for *_, difference in found] == holm(
        [over_drives(FLEET[start::3], 0.95) for start in (1, 0, 2)]
    )


def test_a_drive_without_a_value_is_left_out_of_that_division_alone():
    found = parts({"light": [None, *LIGHT[1:]], "place": ["city", "country"] * 12})
    drives_in = {
        name: sum(difference.units for by, _, difference in found if by == name)
        for name in ("light", "place")
    }
    assert drives_in == {"light": 23, "place": 24}


def test_what_does_not_divide_the_drives_makes_no_parts():
    assert parts({"light": ["day"] * 24}) == []
    assert parts({"light": [None] * 24}) == []
    assert [value for _, value, _ in parts({"light": ["day"] * 23 + [None]})] == ["day"]
    assert parts({"light": []}, fleet=[]) == []


def test_p_values_are_corrected_for_all_parts_together():
    found = parts({"light": LIGHT, "place": ["city", "country"] * 12})
    expected = multipletests([difference.p for *_, difference in found], method="holm")[1]
    assert [difference.p_holm for *_, difference in found] == pytest.approx(expected.tolist())
    assert {difference.comparisons for *_, difference in found} == {5}


def test_parts_in_which_nothing_can_be_found_are_not_counted():
    weather = ["fog"] * 2 + ["rain"] * 10 + ["sun"] * 12
    fleet = FLEET[:12] + drives([0.0] * 12)
    fog, rain, sun = (difference for *_, difference in parts({"weather": weather}, fleet))
    assert fog.p is fog.p_holm is sun.p_holm is sun.comparisons is None
    assert (rain.p_holm, rain.comparisons) == (rain.p, 1)
