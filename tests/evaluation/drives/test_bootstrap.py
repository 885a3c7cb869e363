"""Pooled rates over drives."""

import numpy as np
import pytest
from scipy import special, stats

from roadeval.evaluation.drives.bootstrap import (
    pooled_counts,
    pooled_difference,
    pooled_interval,
    resampled,
)
from roadeval.evaluation.drives.effect import Clusters
from roadeval.evaluation.drives.settings import AcrossSettings
from tests.evaluation.drives.making import drives

SETTINGS = AcrossSettings()


def counts(groups: int, seed: int = 1) -> np.ndarray:
    """Counts of groups whose difference of pooled rates is about 2 points."""
    rng = np.random.default_rng(seed)
    labelled = rng.integers(1000, 9000, groups).astype(float)
    wrong = labelled * rng.uniform(0.1, 0.3, groups)
    change = labelled * rng.normal(0.02, 0.03, groups)
    return np.stack([wrong, labelled, wrong + change, labelled], axis=1)


def test_rates_are_those_of_all_pixels_together() -> None:
    fleet = drives([0.1, 0.2], counts=[(10, 100, 20, 90), (0, 300, 60, 310)])
    sums = pooled_counts(Clusters.of(fleet[:1])).sum(axis=0)
    assert pooled_difference(sums) == pytest.approx(20 / 90 - 10 / 100)
    sums = pooled_counts(Clusters.of(fleet)).sum(axis=0)
    assert pooled_difference(sums) == pytest.approx(80 / 400 - 10 / 400)


def test_a_group_s_counts_are_added_up() -> None:
    of = [(1, 10, 2, 10), (3, 20, 4, 20), (5, 30, 6, 30)]
    fleet = drives([0.1, 0.2, 0.3], groups=["day", "night", "day"], counts=of)
    assert pooled_counts(Clusters.of(fleet)).tolist() == [[6, 40, 8, 40], [3, 20, 4, 20]]


def test_counts_are_unknown_where_one_drive_s_are() -> None:
    fleet = drives([0.1, 0.2], counts=[(1, 10, 2, 10), None])
    assert pooled_counts(Clusters.of(fleet)) is None
    assert pooled_counts(Clusters.of([])) is None


def test_drawn_fleets_are_as_many_and_vary_as_those_of_a_plain_loop() -> None:
    of, rng = counts(40), np.random.default_rng(3)
    loop = [pooled_difference(of[rng.integers(40, size=40)].sum(axis=0)) for _ in range(10_000)]
    found = resampled(of, SETTINGS)
    assert len(found) == 10_000
    assert found.mean() == pytest.approx(np.mean(loop), abs=5 * np.std(loop) / 100)
    assert found.std() == pytest.approx(np.std(loop), rel=0.05)


def test_the_interval_is_the_percentile_interval_widened_for_few_groups() -> None:
    of = counts(8)
    tail = special.ndtr(-np.sqrt(8 / 7) * stats.t.ppf(0.975, 7))
    assert tail < 0.01
    expected = np.quantile(resampled(of, SETTINGS), [tail, 1 - tail])
    assert pooled_interval(of, SETTINGS) == pytest.approx(tuple(expected))


def test_the_interval_of_many_groups_is_that_of_scipy_s_bootstrap() -> None:
    of = counts(300)
    expected = stats.bootstrap(
        (np.arange(300),),
        lambda places, axis: pooled_difference(of[places].sum(axis=-2)),
        method="percentile",
        rng=np.random.default_rng(4),
    ).confidence_interval
    found = pooled_interval(of, SETTINGS)
    assert found == pytest.approx(expected, abs=0.05 * (found[1] - found[0]))


def test_the_same_seed_gives_the_same_interval_and_another_seed_another() -> None:
    of = counts(20)
    other = pooled_interval(of, AcrossSettings(seed=1))
    assert pooled_interval(of, SETTINGS) == pooled_interval(of.copy(), SETTINGS) != other


def test_drawn_fleets_without_a_labelled_pixel_are_left_out() -> None:
    of = np.zeros((4, 4))
    of[0] = [10, 100, 20, 100]
    found = resampled(of, SETTINGS)
    assert len(found) == pytest.approx(10_000 * (1 - 0.75**4), rel=0.05)
    assert np.ptp(found) < 1e-12
