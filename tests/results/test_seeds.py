"""What several seeds come to."""

import math

import pytest

from roadeval.data.words import points
from roadeval.report.tables import seeds_table
from roadeval.results.sentences import spread_in_words
from tests.report.making import plain_rows

SEEDS = {
    "seeds": [7, 8, 9],
    "totals": {
        "filtered": {"post": {"ERR": [0.0669, 0.0747, 0.0709]}},
        "unfiltered": {"post": {"ERR": [0.05, 0.0612, 0.055]}},
    },
    "difference": {"post": {"ERR": [0.0169, -0.0135, 0.0159]}},
}


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ([0.03, 0.01, 0.02], "+2.00 (+1.00 to +3.00)"),
        ([0.01, 0.02, 0.03, 0.1], "+2.50 (+1.00 to +10.00)"),
        ([None, 0.02, math.nan], "+2.00 (+2.00 to +2.00)"),
        ([None, math.nan], "–"),  # noqa: RUF001
        ([], "–"),  # noqa: RUF001
    ],
)
def test_a_spread_is_the_middle_the_least_and_the_greatest_of_what_is_defined(values, told):
    assert spread_in_words(values, points) == told


def test_every_variant_has_a_row_and_the_filter_s_effect_has_one():
    table = seeds_table(SEEDS, ["filtered", "unfiltered"])
    assert [row[:2] for row in plain_rows(table)] == [
        ["filtered", "7.09 (6.69 to 7.47)"],
        ["unfiltered", "5.50 (5.00 to 6.12)"],
        ["filtered \N{MINUS SIGN} unfiltered, pp", "+1.59 (\N{MINUS SIGN}1.35 to +1.69)"],
    ]
    assert "with seeds 7 to 9 of the training" in table.caption
    assert "All else is of seed 7." in table.caption
