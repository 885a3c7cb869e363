"""A fleet's differences, summed up."""

import math
import time

import numpy as np
import pytest
from scipy import stats

from roadeval.evaluation.drives import AcrossSettings, Method, NoInterval, across_drives
from roadeval.evaluation.drives.sign_flip import sign_flip_interval, sign_flip_p
from tests.evaluation.drives.making import drives

SETTINGS = AcrossSettings()


def normal(count: int, mean: float = 0.01) -> list[float]:
    return np.random.default_rng(count).normal(mean, 0.02, count).tolist()


def test_thirty_clusters_have_student_s_interval_and_p_value() -> None:
    found, expected = across_drives(drives(normal(30)), SETTINGS), stats.ttest_1samp(normal(30), 0)
    assert (found.low, found.high) == pytest.approx(tuple(expected.confidence_interval()))
    assert found.p == pytest.approx(expected.pvalue)
    assert (found.method, found.none_because) == (Method.T, None)


def test_fewer_have_those_of_the_sign_flip_test() -> None:
    found, of = across_drives(drives(normal(29)), SETTINGS), np.array(normal(29))
    assert (found.low, found.high) == sign_flip_interval(of, 0.95)
    assert (found.p, found.method) == (sign_flip_p(of), Method.SIGN_FLIP)


def test_five_clusters_have_a_mean_alone_and_the_reason_is_told() -> None:
    counts = [(1, 10, 2, 10)] * 5
    found = across_drives(drives(normal(5), counts=counts), SETTINGS)
    assert found.mean == pytest.approx(np.mean(normal(5)))
    assert (found.low, found.high, found.p, found.method) == (None,) * 4
    assert (found.none_because, found.clusters_needed) == (NoInterval.TOO_FEW_CLUSTERS, 6)
    assert found.pooled == 0.1


@pytest.mark.parametrize(("confidence", "needed"), [(0.9, 6), (0.95, 6), (0.99, 8), (0.999, 11)])
def test_more_confidence_needs_more_clusters(confidence: float, needed: int) -> None:
    settings = AcrossSettings(confidence=confidence)
    too_few = across_drives(drives(normal(needed - 1)), settings)
    assert (too_few.clusters_needed, too_few.p) == (needed, None)
    assert across_drives(drives(normal(needed)), settings).p is not None


@pytest.mark.parametrize("means", [[], [math.nan, math.nan]])
def test_no_drive_at_all_has_no_mean(means: list[float]) -> None:
    found = across_drives(drives(means), SETTINGS)
    assert math.isnan(found.mean)
    assert (found.none_because, found.drives, found.clusters) == (NoInterval.NO_DRIVES, 0, 0)
    assert found.pooled is None


def test_a_drive_without_a_mean_is_left_out() -> None:
    assert across_drives(drives([math.nan, *normal(8)]), SETTINGS) == across_drives(
        drives([*normal(8), math.nan]), SETTINGS
    )
    assert across_drives(drives([*normal(8), math.nan]), SETTINGS).drives == 8


def test_a_group_s_drives_are_averaged_first() -> None:
    groups = ["a", "a", "a", "b", "c", "d", "e", "f"]
    found = across_drives(drives([0.1, 0.2, 0.6, 0.1, 0.2, 0.3, 0.4, 0.5], groups=groups), SETTINGS)
    alone = across_drives(drives([0.3, 0.1, 0.2, 0.3, 0.4, 0.5]), SETTINGS)
    assert (found.mean, found.low, found.high, found.p) == pytest.approx(
        (alone.mean, alone.low, alone.high, alone.p)
    )
    assert (found.drives, found.clusters, alone.clusters) == (8, 6, 6)


def test_the_order_in_which_drives_come_changes_nothing() -> None:
    counts = [(1 + place, 50, 2 * place, 60) for place in range(24)]
    groups = [f"{place % 8}" for place in range(24)]
    fleet = drives(normal(24), groups, counts)
    assert across_drives(fleet, SETTINGS) == across_drives(fleet[::-1], SETTINGS)


def test_drives_are_counted_by_the_direction_in_which_they_changed() -> None:
    fleet = drives([0.1, 0.2, 0.3, -0.1, 0.0, 0.0])
    found = across_drives(fleet, SETTINGS)
    assert (found.worse, found.better, found.equal) == (3, 1, 2)
    other = across_drives(fleet, SETTINGS, higher_is_better=True)
    assert (other.worse, other.better, other.equal) == (1, 3, 2)


@pytest.mark.parametrize("count", [8, 12, 29, 30, 60])
def test_the_interval_leaves_out_0_exactly_where_the_p_value_is_small(count: int) -> None:
    apart = 0
    for shift in np.linspace(0, 0.08, 15):
        found = across_drives(drives([each + shift for each in normal(count, -0.01)]), SETTINGS)
        assert (found.low > 0 or found.high < 0) == (found.p < 0.05)
        apart += found.low > 0
    assert 0 < apart < 15


@pytest.mark.parametrize(("everywhere", "p"), [(0.0, 1.0), (0.25, 0.0)])
def test_forty_drives_that_are_all_alike_have_an_interval_without_width(
    everywhere: float, p: float
) -> None:
    found = across_drives(drives([everywhere] * 40), SETTINGS)
    assert (found.mean, found.low, found.high, found.p) == (everywhere,) * 3 + (p,)


def test_pooled_rates_stand_beside_the_mean() -> None:
    counts = [(10, 100, 10 + place, 100) for place in range(7)]
    found = across_drives(drives(normal(7), counts=counts), SETTINGS)
    assert found.pooled == pytest.approx(0.03)


@pytest.mark.parametrize("counts", [[(0, 0, 0, 0)] * 7, [(1, 10, 2, 10)] * 6 + [None]])
def test_pooled_rates_of_no_labelled_pixel_or_of_a_part_of_the_drives_are_none(counts) -> None:
    assert across_drives(drives(normal(7), counts=counts), SETTINGS).pooled is None


def test_five_thousand_drives_take_about_a_second_at_most() -> None:
    rng = np.random.default_rng(1)
    counts = [(int(wrong), 1000, int(wrong) + 5, 1000) for wrong in rng.integers(1, 500, 5000)]
    fleet = drives(normal(5000), counts=counts)
    across_drives(fleet[:50], SETTINGS)
    start = time.process_time()
    across_drives(fleet, SETTINGS)
    assert time.process_time() - start < 1.5


@pytest.mark.parametrize(("kind", "count"), [("normal", 8), ("t3", 8), ("normal", 40)])
def test_intervals_hold_about_as_often_as_they_claim(kind: str, count: int) -> None:
    rng = np.random.default_rng(7)
    held = []
    for _ in range(150):
        effects = rng.standard_normal(count) if kind == "normal" else rng.standard_t(3, count)
        found = across_drives(drives(effects.tolist()), SETTINGS)
        held.append(found.low <= 0 <= found.high)
    assert 0.9 <= np.mean(held) <= 0.99
