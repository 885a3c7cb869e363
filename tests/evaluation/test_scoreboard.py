"""A drive's score, from its frames to its sums."""

import math

import numpy as np
import pytest

from roadeval.data import Health, Role
from roadeval.evaluation.score import (
    BlindPrior,
    Scoreboard,
)
from roadeval.evaluation.settings import EvaluationSettings
from tests.evaluation.making import a_frame, a_variant, pixels

TRUTH = pixels("##..", "##.?")
FILTERED = a_variant(
    "filtered", {"svm": pixels("#...", "#..."), "post": pixels("##..", "#...")}, {"lit": TRUTH}
)
UNFILTERED = a_variant("unfiltered", {"svm": TRUTH, "post": pixels("##..", "##..")})


def a_board(prior: BlindPrior | None = None, window: int = 10) -> Scoreboard:
    settings = EvaluationSettings(window=window, boundary_width=1, bands=2)
    return Scoreboard(settings, ["filtered", "unfiltered"], prior)


def a_drive(frames: int, board: Scoreboard) -> Scoreboard:
    for number in range(frames):
        frame = a_frame(TRUTH, number)
        board.add(board.score(frame, Role.EVALUATED, (FILTERED, UNFILTERED)))
    return board


@pytest.mark.parametrize("role", [Role.TRAINING, Role.GAP, Role.UNLABELLED])
def test_only_evaluated_frames_are_counted(role: Role) -> None:
    board = a_board()
    truth = None if role is Role.UNLABELLED else TRUTH
    result = board.score(a_frame(truth), role, (FILTERED,))
    board.add(result)
    assert result.tallies == ()
    assert board.roles() == {role: 1}
    assert board.totals() == {}


def test_health_is_judged_and_counted_by_final_masks() -> None:
    board = a_drive(3, a_board())
    result = board.score(a_frame(TRUTH), Role.EVALUATED, (FILTERED, UNFILTERED))
    assert result.health == {"filtered": Health.OK, "unfiltered": Health.OK}
    assert board.summary()["health"] == {"filtered": {"ok": 3}, "unfiltered": {"ok": 3}}


def test_a_frame_that_ignores_every_pixel_has_undefined_rates_and_is_counted_so() -> None:
    board = a_board()
    frame = a_frame(np.full_like(TRUTH, 255))
    board.add(board.score(frame, Role.EVALUATED, (FILTERED,)))
    totals = board.totals()["filtered"]["post"]
    assert totals["N"] == 0
    assert math.isnan(totals["ERR"])
    assert totals["undefined"]["ERR"] == 1


# --- The mask that never looks at the image -------------------------------------------------------


def test_the_prior_is_the_mean_truth() -> None:
    prior = BlindPrior.of_truths([pixels("##.."), pixels("#.#."), pixels("#...")])
    assert prior.road.dtype == np.float32
    assert prior.road == pytest.approx(np.array([[1, 1 / 3, 1 / 3, 0]]))


def test_ignored_pixels_are_left_out_of_the_mean() -> None:
    prior = BlindPrior.of_truths([pixels("?#?"), pixels("##?")])
    assert prior.road.tolist() == [[1, 1, 0]]


def test_the_mask_fits_a_frame_of_another_size() -> None:
    prior = BlindPrior.of_truths([pixels("..##", "..##")])
    assert (prior.mask((4, 8)).pixels() == pixels(*["....####"] * 4)).all()


def test_truths_of_several_sizes_make_one_prior() -> None:
    prior = BlindPrior.of_truths([pixels("..##"), pixels(*["....####"] * 2)])
    assert prior.road.tolist() == [[0, 0, 1, 1]]
