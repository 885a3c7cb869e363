"""Rates with each seed of the training, from the frames' counts."""

from dataclasses import replace

import pytest

from roadeval.data import Packed, Role
from roadeval.evaluation.score import BlindPrior, Scoreboard
from roadeval.evaluation.settings import EvaluationSettings
from tests.evaluation.making import a_frame, a_variant, pixels

TRUTH = pixels("##..", "##..")
RIGHT, ONE_WRONG, TWO_WRONG = TRUTH, pixels("###.", "##.."), pixels("####", "##..")


def with_seeds(name, own, **others):
    """A variant with a final mask of its own, and those with other seeds, as ``seed_3``."""
    repeats = {int(seed[5:]): {"post": Packed.of(mask)} for seed, mask in others.items()}
    return replace(a_variant(name, {"post": own}), repeats=repeats)


def a_board(*frames, prior=None):
    board = Scoreboard(
        EvaluationSettings(boundary_width=1, bands=1), ["filtered", "unfiltered", "net"], prior
    )
    for number, variants in enumerate(frames):
        board.add(board.score(a_frame(TRUTH, number), Role.EVALUATED, variants))
    return board


def test_the_rates_stand_in_the_order_of_the_seeds_the_run_s_own_first():
    filtered = with_seeds("filtered", RIGHT, seed_11=TWO_WRONG, seed_10=ONE_WRONG)
    unfiltered = with_seeds("unfiltered", ONE_WRONG, seed_10=ONE_WRONG, seed_11=RIGHT)
    found = a_board((filtered, unfiltered)).repeats()
    assert found["totals"]["filtered"]["post"]["ERR"] == [0, 1 / 8, 2 / 8]
    assert found["totals"]["filtered"]["post"]["pooled_FPR"] == [0, 1 / 4, 2 / 4]
    assert found["totals"]["unfiltered"]["post"]["ERR"] == [1 / 8, 1 / 8, 0]
    assert found["difference"]["post"]["ERR"] == [-1 / 8, 0, 2 / 8]


def test_the_rates_are_means_over_the_frames():
    frames = [
        (with_seeds("filtered", RIGHT, seed_1=mask),) for mask in (RIGHT, ONE_WRONG, TWO_WRONG)
    ]
    found = a_board(*frames).repeats()
    assert found["totals"]["filtered"]["post"]["ERR"] == [0, pytest.approx(1 / 8)]
    assert found["difference"] == {}


def test_masks_that_no_training_made_are_not_among_them():
    net = a_variant("net", {"post": ONE_WRONG})
    prior = BlindPrior.of_truths([TRUTH])
    found = a_board((with_seeds("filtered", RIGHT, seed_1=RIGHT), net), prior=prior).repeats()
    assert list(found["totals"]) == ["filtered"]


def test_without_a_further_seed_there_is_nothing():
    assert a_board((with_seeds("filtered", RIGHT),)).repeats() == {}


def test_a_frame_that_is_not_evaluated_counts_with_no_seed():
    board = a_board((with_seeds("filtered", RIGHT, seed_1=RIGHT),))
    training = (with_seeds("filtered", TWO_WRONG, seed_1=TWO_WRONG),)
    board.add(board.score(a_frame(TRUTH, 1), Role.TRAINING, training))
    assert board.repeats()["totals"]["filtered"]["post"]["ERR"] == [0, 0]


def test_without_a_filtered_variant_there_is_no_difference():
    found = a_board((with_seeds("unfiltered", RIGHT, seed_1=ONE_WRONG),)).repeats()
    assert found["difference"] == {}
