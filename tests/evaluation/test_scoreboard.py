"""A drive's score, from its frames to its sums; a frame's health; the paper's claims."""

import math

import numpy as np
import pandas as pd
import pytest

from roadeval.data import Counts, Health, Role
from roadeval.evaluation import metrics, tables
from roadeval.evaluation.score.frame import BlindPrior, judge
from roadeval.evaluation.score.scoreboard import Scoreboard, evidence
from roadeval.evaluation.settings import EvaluationSettings
from tests.evaluation.making import a_frame, a_variant, pixels, table_of
from tests.results.making import KEY, frames_of

TRUTH = pixels("##..", "##.?")
FILTERED = a_variant(
    "filtered", {"svm": pixels("#...", "#..."), "post": pixels("##..", "#...")}, {"lit": TRUTH}
)
UNFILTERED = a_variant("unfiltered", {"svm": TRUTH, "post": pixels("##..", "##..")})


def a_board(prior=None, window=10):
    settings = EvaluationSettings(window=window, boundary_width=1, bands=2)
    return Scoreboard(KEY, settings, ["filtered", "unfiltered"], prior)


def test_the_tables_of_the_run_are_those_that_its_rows_read_back_as():
    """The second variant misses the first frames; the baseline comes last in every table."""
    board, results = a_board(BlindPrior.of_truths([TRUTH]), window=5), []
    for number in range(12):
        variants = (FILTERED, UNFILTERED)[: 1 + (number > 2)]
        results.append(board.score(a_frame(TRUTH, number), Role.EVALUATED, variants))
        board.add(results[-1])
    sums, read = board.summary(), frames_of(results)
    ours = board.frames().sort_values(["frame", "variant", "stage"])
    theirs = read.drop(columns=["log_time_ns", "truth"])
    theirs = theirs.assign(
        variant=theirs["variant"].cat.set_categories(ours["variant"].cat.categories)
    )
    theirs = theirs.sort_values(["frame", "variant", "stage"])
    for name in theirs:
        assert ours[name].astype(theirs[name].dtype).tolist() == pytest.approx(
            theirs[name].tolist(), nan_ok=True
        )
    assert sums.parts["totals"] == tables.as_trees(tables.totals(read))
    assert [*sums.parts["totals"]] == ["filtered", "blind", "unfiltered"]
    assert sums.windows["variant"].unique().tolist() == ["filtered", "unfiltered", "blind"]
    assert sums.parts["windows"] == 3


@pytest.mark.parametrize("role", [Role.TRAINING, Role.GAP, Role.UNLABELLED])
def test_only_evaluated_frames_are_counted(role):
    board = a_board()
    truth = None if role is Role.UNLABELLED else TRUTH
    result = board.score(a_frame(truth), role, (FILTERED,))
    board.add(result)
    assert result.tallies == ()
    assert board.roles() == {role: 1}
    sums = board.summary()
    assert (len(sums.frames), len(sums.windows), sums.effects) == (0, 0, [])
    assert (sums.parts["totals"], sums.parts["windows"], sums.parts["claims"]) == ({}, 0, {})


def test_health_is_judged_and_counted_by_final_masks():
    board = a_board()
    for number in range(3):
        result = board.score(a_frame(TRUTH, number), Role.EVALUATED, (FILTERED, UNFILTERED))
        board.add(result)
    assert result.health == {"filtered": Health.OK, "unfiltered": Health.OK}
    assert board.summary().parts["health"] == {"filtered": {"ok": 3}, "unfiltered": {"ok": 3}}


def test_a_frame_that_ignores_every_pixel_has_undefined_rates_and_is_counted_so():
    board = a_board()
    frame = a_frame(np.full_like(TRUTH, 255))
    board.add(board.score(frame, Role.EVALUATED, (FILTERED,)))
    totals = board.summary().parts["totals"]["filtered"]["post"]
    assert (totals["N"], totals["undefined"]["ERR"]) == (0, 1)
    assert math.isnan(totals["ERR"])


# --- The mask that never looks at the image -------------------------------------------------------


def test_the_prior_is_the_mean_truth():
    prior = BlindPrior.of_truths([pixels("##.."), pixels("#.#."), pixels("#...")])
    assert prior.road.dtype == np.float32
    assert prior.road == pytest.approx(np.array([[1, 1 / 3, 1 / 3, 0]]))


def test_ignored_pixels_are_left_out_of_the_mean():
    prior = BlindPrior.of_truths([pixels("?#?"), pixels("##?")])
    assert prior.road.tolist() == [[1, 1, 0]]


def test_the_mask_fits_a_frame_of_another_size():
    prior = BlindPrior.of_truths([pixels("..##", "..##")])
    assert (prior.mask((4, 8)).pixels() == pixels(*["....####"] * 4)).all()


def test_truths_of_several_sizes_make_one_prior():
    prior = BlindPrior.of_truths([pixels("..##"), pixels(*["....####"] * 2)])
    assert prior.road.tolist() == [[0, 0, 1, 1]]


# --- When a frame is fine, degraded or failed -----------------------------------------------------


@pytest.mark.parametrize(
    ("counts", "blind", "health"),
    [
        (Counts(50, 35, 15, 0), None, Health.DEGRADED),
        (Counts(50, 25, 25, 0), None, Health.FAILED),
        (Counts(0, 95, 0, 5), None, Health.FAILED),  # it finds no road, however little there is
        (Counts(tn=100), None, Health.OK),
        (Counts(tn=70, fp=30), None, Health.FAILED),
        (Counts(50, 42, 8, 0), Counts(50, 43, 7, 0), Health.OK),
        (Counts(50, 42, 8, 0), Counts(50, 45, 5, 0), Health.DEGRADED),
    ],
)
def test_a_frame_is_judged_by_its_errors_its_road_and_the_baseline(counts, blind, health):
    assert judge(metrics.of(counts), blind and metrics.of(blind)) is health


# --- The paper's claims, on windows written by hand -----------------------------------------------

FRAMES = [10, 10, 10, 3]


def claims(**masks):
    """The evidence of windows of masks, each with one value for every rate."""
    rows = [
        {"window": number, "frames": FRAMES[number], "variant": variant, "stage": stage}
        | dict.fromkeys(("ERR", "FPR", "FNR"), err)
        for mask, errs in masks.items()
        for variant, stage in [mask.split("_")]
        for number, err in enumerate(errs)
    ]
    found = evidence(table_of("windows", rows), 10)
    return {name: tuple(counted.values()) for name, counted in found.items()}


def test_full_windows_and_shorter_ones_are_counted_apart():
    """Held and in all, of full windows and then of shorter ones."""
    found = claims(filtered_post=[0.1, 0.3, 0.1, 0.1], unfiltered_post=[0.2] * 4)
    assert found["filter_ERR"] == (2, 3, 1, 1)


def test_equal_rates_do_not_bear_a_claim_out_and_undefined_ones_are_in_no_count():
    found = claims(filtered_post=[0.1, 0.2, math.nan], unfiltered_post=[0.2] * 3)
    assert found["filter_FNR"] == (1, 2, 0, 0)


def test_stages_are_held_against_those_before_them():
    found = claims(filtered_similarity=[0.3], filtered_svm=[0.2], filtered_post=[0.25])
    assert found == {"svm_ERR": (1, 1, 0, 0), "post_ERR": (0, 1, 0, 0)}


def test_without_windows_there_is_no_claim():
    assert evidence(tables.windows(table_of("frames", []), 10), 10) == {}
    assert evidence(pd.DataFrame(columns=["variant", "stage"]), 10) == {}
