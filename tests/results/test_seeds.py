"""What several seeds come to, in numbers and in a sentence."""

import math

import pytest

from roadeval.results.sentences import of_seeds, spread, spread_in_words

SEEDS = {
    "seeds": [7, 8, 9],
    "totals": {
        "filtered": {"post": {"ERR": [0.0669, 0.0747, 0.0709]}},
        "unfiltered": {"post": {"ERR": [0.05, 0.0612, 0.055]}},
    },
    "difference": {"post": {"ERR": [0.0169, -0.0135, 0.0159]}},
}


@pytest.mark.parametrize(
    ("values", "found"),
    [
        ([3, 1, 2], (2, 1, 3)),
        ([1, 2, 3, 10], (2.5, 1, 10)),
        ([None, 2, math.nan], (2, 2, 2)),
        ([None, math.nan], None),
        ([], None),
    ],
)
def test_a_spread_is_the_middle_the_least_and_the_greatest_of_what_is_defined(values, found):
    assert spread(values) == found


def test_the_sentence_names_the_seeds_every_variant_the_effect_and_whose_tables_they_are():
    assert of_seeds(SEEDS) == (
        "With seeds 7 to 9 of the training ERR of post is: filtered 6.69 to 7.47 % (middle 7.09), "
        "unfiltered 5.00 to 6.12 % (middle 5.50) and filtered minus unfiltered -1.35 to +1.69 pp "
        "(middle +1.59). Tables and recording are those of seed 7."
    )


def test_one_variant_has_no_effect_to_tell():
    alone = SEEDS | {"totals": {"unfiltered": SEEDS["totals"]["unfiltered"]}, "difference": {}}
    assert of_seeds(alone) == (
        "With seeds 7 to 9 of the training ERR of post is: unfiltered 5.00 to 6.12 % (middle "
        "5.50). Tables and recording are those of seed 7."
    )


def test_rates_that_are_defined_on_no_frame_are_said_to_be():
    none = {"filtered": {"post": {"ERR": [None, None, None]}}}
    told = of_seeds(SEEDS | {"totals": none, "difference": {}})
    assert told == "With seeds 7 to 9 of the training ERR of post is undefined on every frame."
    assert spread_in_words([None]) == "–"  # noqa: RUF001
