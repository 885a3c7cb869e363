"""The lines of a history: which drives are paired, and what a step is worth."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from benchmarks.history import FLEETS, NOISES, POINT, Fleet, complete, history, plant
from roadeval.data.arrays import Floats
from roadeval.evaluation.comparison.conditions import Condition
from roadeval.evaluation.comparison.history import (
    find_changes,
    find_lines,
    judge_last,
    number_pixels,
)
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.steps import ChangePoint, trace

DRIVES = [*"abcdefgh"]
RUNS = 12
KINDS = ("all", "region", "class")


def rows_of(change=lambda run, drive: 0.0, runs=RUNS, **columns):
    """The rows of final masks of eight drives, with what a function adds to their rates.

    A drive of which it returns NaN is not in the run; ``columns`` return other values of a column.
    """
    rows = []
    for run in range(runs):
        for place, drive in enumerate(DRIVES):
            added = change(run, drive)
            row = {"run": run, "drive": drive, "camera": "/c", "group": drive, "log_digest": drive}
            row["source"] = ""
            row |= {"variant": "mine", "stage": "post", "kind": "all", "part": "all", "truth": 1}
            row |= {"frames": 10, "road": 300, "N": 1000, "tag_light": "dusk"[: 4 * (place < 3)]}
            row |= dict.fromkeys(("ERR", "FPR", "FNR"), 0.02 + 0.01 * place + added)
            row |= {name: value(run, drive) for name, value in columns.items()}
            rows += [] if math.isnan(added) else [row]
    made = pd.DataFrame(rows).replace("", None)
    return made.assign(pixels=number_pixels(made))


def no_frames(line, before, after):
    raise AssertionError("several drives are judged over drives")


def lines_of(rows):
    tags = {"tag_light": "light"}
    lines = find_lines(rows, tags, RUNS, 0.95)
    return {(line.kind, line.part, line.rate): line for line in lines}


ERR = "all", "all", "ERR"


def test_a_step_is_that_of_its_run_with_the_drives_that_carry_it():
    line = lines_of(rows_of(lambda run, drive: 0.05 * (run >= 7 and drive in "ab")))[ERR]
    (change,) = find_changes([line], 0.95, no_frames)
    assert (change.step.kind, change.step.run) == ("step", 7)
    assert change.difference.mean == pytest.approx(0.0125)
    assert (change.difference.worse, change.difference.equal) == (2, 6)
    assert change.drives["drive"].tolist()[:2] == ["a", "b"]
    assert (change.drives["mean"].iloc[2:] == 0).all()


def test_drives_that_come_and_go_make_no_step_and_the_level_is_that_of_the_last_ones():
    def hard_drives_go(run, drive):
        return math.nan if drive in "gh" and run >= 6 else 0.0

    line = lines_of(rows_of(hard_drives_go))[ERR]
    assert not line.steps
    assert line.rates[0] > line.rates[-1]
    np.testing.assert_allclose(line.levels, line.rates[-1], atol=1e-12)


@pytest.mark.parametrize("column", ["camera", "truth", "log_digest", "frames", "road", "N"])
def test_a_drive_of_other_pixels_begins_anew(column):
    def is_new(run, drive):
        return 2 if run >= 7 and drive == "a" else 1

    rows = rows_of(lambda run, drive: 0.3 * (is_new(run, drive) == 2), **{column: is_new})
    assert not lines_of(rows)[ERR].steps
    rows = rows_of(lambda run, drive: 0.3 * (run >= 7), **{column: lambda run, drive: run >= 7})
    assert not lines_of(rows)[ERR].steps


@pytest.mark.parametrize(("tag", "name"), [("light", "light"), *((n, f"tag_{n}") for n in KINDS)])
def test_a_tag_is_a_line_of_its_drives_alone_whatever_its_name(tag, name):
    rows = rows_of(lambda run, drive: 0.02 * (run >= 7 and drive in "abc"))
    rows = rows.rename(columns={"tag_light": f"tag_{tag}"})
    lines = {line.title: line for line in find_lines(rows, {f"tag_{tag}": tag}, RUNS, 0.95)}
    assert [*lines] == ["ERR", "FPR", "FNR", f"ERR, {name} dusk"]
    dusk = lines[f"ERR, {name} dusk"]
    assert (dusk.kind, dusk.drives["drive"].tolist()) == (name, ["a", "b", "c"])
    (step,) = dusk.steps
    assert (step.run, step.change) == (7, pytest.approx(0.02))


def test_a_run_that_stands_out_is_no_part_of_the_level_beside_it():
    def added(run, drive):
        return 0.1 * (run == 4) + 0.02 * (run >= 7)

    line = lines_of(rows_of(added))[ERR]
    changes = find_changes([line], 0.95, no_frames)
    assert [change.step.kind for change in changes] == ["outlier", "step"]
    assert [change.difference.mean for change in changes] == pytest.approx([0.1, 0.02])
    assert changes[1].difference.worse == 8


def test_no_level_is_below_zero():
    def an_easy_drive_stays(run, drive):
        gone = run < 6 if drive == "a" else run == 11
        return math.nan if gone else 0.08 * (drive != "a" and run >= 6)

    line = lines_of(rows_of(an_easy_drive_stays))[ERR]
    assert (line.levels.min(), len(line.steps)) == (0, 1)


def test_drives_of_a_group_count_as_one():
    columns = {"group": lambda _, drive: "pair" if drive in "ab" else drive}
    columns["truth"] = lambda run, drive: drive == "c" and run >= 3
    rows = rows_of(lambda run, drive: 0.07 * (run >= 7 and drive in "ab"), **columns)
    line = lines_of(rows)[ERR]
    assert line.rates[0] == pytest.approx((0.02 / 2 + 0.03 / 2 + 0.39) / 7)
    (change,) = find_changes([line], 0.95, no_frames)
    assert change.difference.mean == pytest.approx(0.01)
    assert change.difference.groups == 7


def judged(rows, *texts, last=5):
    lines, settings = find_lines(rows, {}, RUNS, 0.95), EvaluationSettings()
    conditions = [Condition.parse(text) for text in texts]
    return [*judge_last(lines, conditions, last, settings, no_frames)]


def test_the_last_run_is_judged_against_the_mean_of_those_before():
    rows = rows_of(lambda run, drive: 0.004 * (run % 2) + 0.01 * (run == 11))
    texts = (f"post.mine.ERR {limit}" for limit in ("> +1pp", "< 50%", "> +1pp surely"))
    change, level, surely = judged(rows, *texts)
    assert change.value == pytest.approx(0.01 + 0.004 * 3 / 5)
    assert change.after == pytest.approx(rows[rows["run"] == 11]["ERR"].mean())
    assert (change.holds, level.holds) == (True, True)
    # The noise of the runs before is in the interval.
    assert not surely.holds
    assert surely.low < change.value - 0.001
    # Runs that are not there make nothing surer.
    text = surely.condition.text
    assert judged(rows, text, last=99) == judged(rows, text, last=11)


def test_a_rate_that_did_not_change_was_the_same_before():
    (unchanged,) = judged(rows_of(lambda run, drive: 0.0), "post.mine.ERR > +1pp")
    assert (unchanged.value, unchanged.before) == (0, unchanged.after)
    assert unchanged.after > 0


def test_a_change_is_from_and_to_the_rates_of_the_drives_that_changed():
    def two_at_first(run, drive):
        return (math.nan, 0.0)[drive in "gh"] if run < 11 else 0.03

    change, level = judged(rows_of(two_at_first), "post.mine.ERR > +1pp", "post.mine.ERR > 1%")
    assert (change.before, change.after) == pytest.approx((0.085, 0.115))
    assert level.after == pytest.approx(0.085)


def test_a_condition_on_what_is_not_there_is_not_judged():
    gone = rows_of(lambda run, drive: 0.0)
    gone = gone[(gone["run"] < 11) | (gone["drive"] == "a")]
    gone.loc[gone["run"] == 11, "truth"] = 2
    gone = gone.assign(pixels=number_pixels(gone))
    (unknown,) = judged(gone, "post.yours.ERR > +1pp")
    assert unknown.holds is None
    assert "post.mine.ERR" in unknown.why
    (change,) = judged(gone, "post.mine.ERR > +1pp")
    assert change.holds is None
    assert "no drive" in change.why


def test_the_only_drive_is_judged_over_its_frames_of_the_runs_that_count():
    def added(run, drive):  # in run 4 one stands out, and one drive goes
        here = run != 1 if drive == "a" else drive == "b" and run < 3
        return 0.1 * (run == 4) + 0.02 * (run >= 7) if here else math.nan

    asked = []

    def within(line, before, after):
        asked.append((line.drives["drive"].tolist(), before, after))
        return find_changes([eight], 0.95, no_frames)[0].difference

    eight = lines_of(rows_of(lambda run, drive: 0.02 * (run >= 7)))[ERR]
    line = lines_of(rows_of(added))[ERR]
    _, step = find_changes([line], 0.95, within)
    assert asked == [(["a"], [0, 2, 3], [4]), (["a"], [0, 2, 3, 5, 6], [7, 8, 9, 10, 11])]
    gone = replace(step.difference, mean=math.nan)  # of frames
    _, step = find_changes([line], 0.95, lambda *_: gone)
    assert (step.difference.mean, step.difference.low) == (pytest.approx(0.02), None)


# --- Steps, drifts and outliers that are planted are named, and by chance hardly anything is ------


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


@pytest.mark.parametrize(
    ("noise", "runs", "histories"),
    [
        # If few differences told the noise as many do, 2 to 7 of these 60 would name something.
        *((noise, 30, 60) for noise in NOISES),
        # At half the limit, 1 and 3 of these 10 years with heavy tails would name something.
        *((noise, 365, 10) for noise in ("t3", "contaminated")),
    ],
)
def test_histories_without_a_change_name_nothing(noise: str, runs: int, histories: int) -> None:
    rngs = [np.random.default_rng([8, number]) for number in range(histories)]
    assert not any(look(history(rng, runs, 5, NOISES[noise], run_noise=0.2)) for rng in rngs)


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
