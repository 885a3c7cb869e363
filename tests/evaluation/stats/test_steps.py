"""Steps, drifts and outliers that are planted are named, and by chance hardly anything is."""

import math

import numpy as np
import pytest

from benchmarks.history import FLEETS, NOISES, POINT, Fleet, complete, history, plant
from roadeval.data.arrays import Floats
from roadeval.evaluation.stats.steps import ChangePoint, trace


def look(values: Floats, family: int = 1) -> tuple[ChangePoint, ...]:
    """Return the steps of a history whose drives count alike."""
    return trace(values, np.ones(values.shape[1]), family).steps


def exact(*points: float, drives: int = 3) -> Floats:
    """Return a history in which all drives change alike, by so many points."""
    return POINT * (np.arange(drives) + 5 + np.array(points)[:, None])


@pytest.mark.parametrize("family", [1, 40])
@pytest.mark.parametrize("before", [2, 3, 200])
def test_an_exact_history_names_a_change_in_its_first_run(before: int, family: int) -> None:
    changed = exact(*[0.0] * before, 0.05)
    assert not look(changed[:-1], family)
    (step,) = look(changed, family)
    assert step[:-1] == ("step", 0, before, before, before)
    assert step.change == pytest.approx(0.05 * POINT)


def test_a_change_of_some_drives_in_an_exact_history_is_named_in_its_first_run() -> None:
    values = exact(*[0.0] * 120, drives=20)
    values[100:, 3] += 2 * POINT
    assert [(step.run, step.alarm) for step in look(values)] == [(100, 100)]


def test_a_tool_that_ceases_to_be_exact_soon_names_no_more() -> None:
    steps = look(exact(*[0.0] * 60, *np.random.default_rng(1).normal(size=50)))
    assert steps[0].alarm == 60
    assert steps[-1].alarm < 75


def test_a_step_of_one_run_becomes_an_outlier_and_the_old_level_goes_on() -> None:
    values = exact(0, 0, 0, 0, 2, 0, 0, 1, 1)
    assert [step.kind for step in look(values[:5])] == ["step"]
    outlier, step = look(values)
    assert outlier[:-1] == ("outlier", 0, 4, 4, 4)
    assert step[:-1] == ("step", 0, 7, 8, 7)
    assert [outlier.change, step.change] == pytest.approx([2 * POINT, POINT])


def test_steps_in_one_direction_without_a_plateau_are_one_drift() -> None:
    (drift,) = look(exact(0, 0, 0, 0, 0, 1, 2, 3, 4, 4, 4, 4))
    assert drift[:-1] == ("drift", 0, 5, 8, 5)
    assert drift.change == pytest.approx(4 * POINT)


def test_a_slow_rise_in_noise_is_one_drift() -> None:
    values = history(np.random.default_rng(1), 150, 200, NOISES["normal"])
    (drift,) = look(values + plant("drift", 150, 2)[0])
    assert drift.kind == "drift"
    assert 72 <= drift.run < drift.after < 110
    assert drift.change == pytest.approx(2 * POINT, abs=0.2 * POINT)


def test_drives_that_got_worse_and_are_dropped_later_make_no_step() -> None:
    values = history(np.random.default_rng(2), 120, 20)
    values[40:, :5] += 5 * POINT
    values[80:, :5] = math.nan
    (step,) = look(values)
    assert (step.kind, step.run, step.after) == ("step", 40, 119)
    assert step.change == pytest.approx(5 / 4 * POINT, abs=0.3 * POINT)


@pytest.mark.parametrize("fleet", FLEETS.values())
def test_drives_that_come_and_go_make_no_step_in_an_exact_history(fleet: Fleet) -> None:
    rng = np.random.default_rng(3)
    values = history(rng, 200, 20, fleet=fleet, run_noise=0, spread=(1e-9, 2e-9))
    assert not look(values)
    values[150:] += 0.05 * POINT
    assert [(step.run, step.alarm) for step in look(values)] == [(150, 150)]


def test_levels_of_a_full_matrix_are_those_of_the_weighted_mean() -> None:
    values = history(np.random.default_rng(4), 60, 4, fleet=complete)
    values[30:, 1] += 8 * POINT
    weights = np.array([1.0, 2.0, 0.5, 0.5])
    levels = trace(values, weights).levels
    means = values @ weights / 4
    np.testing.assert_allclose(levels - levels[0], means - means[0], atol=1e-12)


def test_a_look_names_what_the_longer_history_says_for_that_night() -> None:
    values = history(np.random.default_rng(5), 60, 20)
    values[20:] += 3 * POINT
    values[35] += 80 * POINT
    values[45:, :10] -= 6 * POINT
    steps = look(values)
    assert [step.kind for step in steps] == ["step", "outlier", "step"]
    assert [step.run for step in steps] == [20, 35, 45]
    for runs in range(18, 61):
        found = [(step.before, step.run, step.alarm) for step in steps if step.alarm < runs]
        assert [(step.before, step.run, step.alarm) for step in look(values[:runs])] == found


def test_the_order_of_drives_does_not_matter() -> None:
    values, weights = history(np.random.default_rng(6), 80, 20), np.linspace(1, 3, 20)
    values[50:] += 2 * POINT
    other = trace(values[:, ::-1], weights[::-1])
    assert trace(values, weights).steps[0][:-1] == other.steps[0][:-1]
    np.testing.assert_allclose(trace(values, weights).levels, other.levels, atol=1e-12)


def test_more_series_need_more_evidence() -> None:
    values = history(np.random.default_rng(7), 100, 20)
    values[60:] += 1.5 * POINT
    (alone,), (one_of_many,) = look(values), look(values, 1000)
    assert alone.run == one_of_many.run == 60
    assert alone.alarm < one_of_many.alarm


def test_runs_without_drives_in_common_have_no_level() -> None:
    none = math.nan
    values = np.array(
        [[none, none], [0.1, none], [0.1, none], [none, 0.3], [none, 0.3], [0.2, 0.4]]
    )
    levels, _, (step,) = trace(values, np.ones(2))
    np.testing.assert_allclose(levels, [none, 0, 0, none, 0, 0.1])
    assert step[:-1] == ("step", 1, 5, 5, 5)


@pytest.mark.parametrize("shape", [(0, 2), (1, 2), (9, 1), (2, 1)])
def test_short_and_empty_histories_have_no_step(shape: tuple[int, int]) -> None:
    assert not look(np.full(shape, math.nan))
    assert not look(np.full(shape, 0.1))


def count_false(noise: str, runs: int, histories: int) -> int:
    """Return how many histories without any change name one."""
    rngs = [np.random.default_rng([8, number]) for number in range(histories)]
    return sum(bool(look(history(rng, runs, 5, NOISES[noise], run_noise=0.2))) for rng in rngs)


@pytest.mark.parametrize("noise", NOISES)
def test_few_runs_name_nothing_by_chance(noise: str) -> None:
    """If few differences told the noise as many do, 2 to 7 of these 60 would name something."""
    assert count_false(noise, 30, 60) == 0


@pytest.mark.parametrize("noise", ["t3", "contaminated"])
def test_a_year_with_heavy_tails_names_nothing_by_chance(noise: str) -> None:
    """At half the limit, 1 and 3 of these 10 years would name something."""
    assert count_false(noise, 365, 10) == 0


def test_ruptures_agrees() -> None:
    """PELT with the penalty of BIC finds every step that is named, and on clear ones no other."""
    ruptures = pytest.importorskip("ruptures")
    named = clear = 0
    for seed in range(24):
        rng, size = np.random.default_rng([9, seed]), (0.0, 1.0, 2.0, 4.0)[seed % 4]
        values = history(rng, 120, 20, NOISES["normal"], complete)
        values[40:] += size * POINT
        values[80:] -= 2 * size * POINT
        mean = values.mean(axis=1, keepdims=True)
        noise = np.diff(mean[:, 0]).std() / math.sqrt(2)
        judge = ruptures.KernelCPD(kernel="linear", min_size=2).fit(mean / noise)
        judged = np.array(judge.predict(pen=2 * math.log(120))[:-1])
        runs = [step.run for step in look(values)]
        assert all(np.abs(judged - run).min() <= 2 for run in runs)
        named += len(runs)
        if size == 4:
            clear += runs == judged.tolist() == [40, 80]
    assert named >= 30
    assert clear == 6
