"""Filtered against unfiltered: the sentences, and the tables' columns."""

import math
from dataclasses import replace

import pytest

from roadeval.data.words import DASH, MINUS
from roadeval.report.blocks import Details, Table, Text
from roadeval.report.sections.drive import filter_effect, pixels_changed
from tests.report.making import a_difference, by_rate, pairs, plain_rows, some_findings, the


def texts(findings):
    return [block.text for block in filter_effect(findings) if isinstance(block, Text)]


@pytest.mark.parametrize(
    ("wrong", "told"), [([1500, -200], "1,300 more"), ([-1500, 200], "1,300 fewer")]
)
def test_more_wrong_pixels_are_more_and_fewer_are_fewer(wrong, told):
    sentence = pixels_changed(30, 10, 1000, sum(wrong))
    assert sentence == (
        "Of the labelled pixels of all evaluated frames, 3.00 % are newly right with the "
        "filter and 1.00 % newly wrong; over all frames that leaves "
        f"{told} wrong pixels in all."
    )


def table_of(findings):
    table, *_ = (block for block in filter_effect(findings) if isinstance(block, Table))
    return table


def test_each_difference_has_both_errors_how_sure_it_is_and_the_frames_it_won():
    effects = {
        "difference": {"post": by_rate(3, 1)},
        "against_blind": {"unfiltered": by_rate(1, 1)},
    }
    table = table_of(some_findings(**effects))
    change = (f"{MINUS}2.00", f"{MINUS}3.00 to {MINUS}1.00 *", f"{MINUS}2.00", f"{MINUS}2.00")
    assert plain_rows(table) == [
        [f"filtered {MINUS} unfiltered", "15.00", "10.00", *change, "3", "1", "40"],
        [f"unfiltered {MINUS} blind", "12.00", "15.00", *change, "1", "1", "40"],
    ]
    assert table.breaks == [1]
    assert sum(columns for _, columns in table.groups) == len(table.columns)


def test_where_there_is_no_interval_the_reason_is_given():
    found = some_findings(difference={"post": by_rate(err=a_difference(-0.02))})
    assert any("No interval for ERR: 1200 frames are too few" in text for text in texts(found))


def test_where_err_is_undefined_nothing_is_said_about_frames():
    unknown = {"post": by_rate(err=a_difference(None))}
    *_, text = texts(some_findings(difference=unknown, filtered=pairs([math.nan], [0])))
    assert text.startswith("ERR is undefined on every frame")


def test_flicker_stands_beside_the_truths_own_and_how_long_a_mask_errs():
    each = {"width": 5, "flicker": 0.05, "truth_flicker": 0.02, "pairs": 1199}
    times = {"limit": 0.15, "seconds": 15.5, "longest": 3.04, "share": 0.25, "recovery": 1.0}
    none = times | {"seconds": 0.0, "longest": 0.0, "share": None, "recovery": None}
    still = {"flicker": None, "truth_flicker": None, "pairs": 0}
    beyond = {
        "filtered": each | {"episodes": times | {"episodes": 1300, "recovered": 12}},
        "blind": each | still | {"episodes": none | {"episodes": 0, "recovered": 0}},
    }
    hidden = the(Details, filter_effect(some_findings(beyond=beyond)))
    table, end = the(Table, hidden.blocks), ("12", "1.0")
    assert plain_rows(table) == [
        ["filtered", *("5.00", "2.00", "+3.00", "1,199"), *("1,300", "15.5", "3.0", "25.00", *end)],
        ["blind", *(DASH, DASH, DASH, "0"), "0", "0.0", "0.0", DASH, "0", DASH],
    ]
    assert sum(columns for _, columns in table.groups) == len(table.columns)
    assert hidden.title == "From one frame to the next"
    assert "an ERR of at least 15 % to the first one below" in the(Text, hidden.blocks).text


def test_an_unknown_number_of_effective_frames_is_a_dash():
    unknown = by_rate(err=replace(a_difference(-0.02, -0.03, -0.01), effective=None))
    assert plain_rows(table_of(some_findings(difference={"post": unknown})))[0][-1] == DASH
