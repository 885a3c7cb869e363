"""The lines of a history: which drives are paired, and what a step is worth."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from roadeval.evaluation.comparison.conditions import Condition
from roadeval.evaluation.comparison.history import (
    find_changes,
    find_lines,
    judge_last,
    number_pixels,
)
from roadeval.evaluation.settings import EvaluationSettings

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
