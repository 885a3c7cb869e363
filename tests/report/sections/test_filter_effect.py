"""Filtered against unfiltered: the sentences, and the tables' columns."""

import math
from dataclasses import replace

import pytest

from roadeval.data.words import DASH, MINUS
from roadeval.report.blocks import Heading, Table, Text
from roadeval.report.sections.drive import filter_effect, frames_changed, pixels_changed
from tests.report.making import a_difference, a_pair, plain_rows, some_findings


def texts(findings):
    return [block.text for block in filter_effect(findings) if isinstance(block, Text)]


@pytest.mark.parametrize(
    ("wrong", "told"), [([1500, -200], "1,300 more"), ([-1500, 200], "1,300 fewer")]
)
def test_more_wrong_pixels_are_more_and_fewer_are_fewer(wrong, told):
    sentence = pixels_changed(some_findings(), a_pair([0.1, -0.1], wrong))
    assert sentence == (
        "Of the labelled pixels of all 1200 evaluated frames, 3.00 % are newly right with the "
        "filter and 1.00 % newly wrong; over all frames that leaves "
        f"{told} wrong pixels in all."
    )


def test_frames_are_lowered_raised_or_left_as_they_are():
    changes = [-0.1, -0.2, -0.3, 0.1, 0.0, math.nan]
    assert frames_changed(a_pair(changes, [0] * 6)) == (
        "Of 5 frames the filter lowers ERR on 3 frames (60 %), raises it on 1 (20 %) "
        "and leaves it on 1 (20 %)."
    )


def test_the_table_has_both_rates_their_difference_and_how_sure_it_is():
    table, *_ = (
        block
        for block in filter_effect(some_findings(paired=[a_pair([-0.1], [-1])]))
        if isinstance(block, Table)
    )
    assert table.columns[1:3] == ["filtered", "unfiltered"]
    assert plain_rows(table)[0] == [
        *("ERR", "10.00", "15.00", f"{MINUS}2.00", f"{MINUS}3.00 to {MINUS}1.00 *", "1,200", "40")
    ]


def test_where_there_is_no_interval_the_reason_is_given():
    pair = a_pair([-0.1], [-1])
    pair.differences["ERR"] = a_difference(-0.02)
    assert any(
        text.startswith("No interval for ERR: 1200 frames are too few")
        for text in texts(some_findings(paired=[pair]))
    )


def test_where_err_is_undefined_nothing_is_said_about_frames():
    pair = a_pair([math.nan], [0])
    pair.differences["ERR"] = a_difference(None)
    text, *_ = texts(some_findings(paired=[pair]))
    assert text.startswith("ERR is undefined on every frame")


def test_against_the_baseline_better_is_a_lower_error():
    pair = a_pair([-0.1, -0.2, 0.3], [0, 0, 0], control="blind")
    table, *_ = (b for b in filter_effect(some_findings(paired=[pair])) if isinstance(b, Table))
    assert table.columns[-2:] == ["frames better", "frames worse"]
    assert plain_rows(table)[0][-2:] == ["2", "1"]


def test_flicker_stands_beside_the_truths_own():
    each = {"boundary_F": 0.5, "width": 5, "flicker": 0.05, "truth_flicker": 0.02, "pairs": 1199}
    unknown = each | {"flicker": None, "truth_flicker": None}
    blocks = list(filter_effect(some_findings(beyond={"filtered": each, "unfiltered": unknown})))
    (table,) = (block for block in blocks if isinstance(block, Table))
    assert plain_rows(table) == [["filtered", "5.00", "2.00", "+3.00", "1,199"]]
    assert "From one frame to the next" in [b.text for b in blocks if isinstance(b, Heading)]


def test_an_unknown_number_of_effective_frames_is_a_dash():
    pair = a_pair([-0.1], [-1])
    pair.differences["ERR"] = replace(pair.differences["ERR"], effective=None)
    table, *_ = (b for b in filter_effect(some_findings(paired=[pair])) if isinstance(b, Table))
    assert plain_rows(table)[0][-1] == DASH


@pytest.mark.parametrize(
    ("counts", "told"),
    [
        ({}, "all 1200 evaluated frames"),
        ({"sampled": 100}, "100 frames spread evenly over the 1200 evaluated"),
        (
            {"sampled": 100, "pictured": 300},
            "100 of the 300 frames whose pictures were kept, out of 1200 evaluated",
        ),
    ],
)
def test_the_frames_whose_masks_were_compared_are_told(counts, told):
    assert f"pixels of {told}" in pixels_changed(some_findings(**counts), a_pair([0.1], [1]))
