"""Rows that are made of sums, and what a drive's row and case say of it."""

import numpy as np
import pytest

from roadeval.results.comparison import junit_xml
from roadeval.results.over_drives import drive_cases
from roadeval.results.rows import drive_row, probability_rows
from tests.results.making import facts_of


def test_a_level_with_as_many_pixels_of_road_as_of_the_rest_has_a_row():
    counts = np.zeros((2, 1 << 16), np.int64)
    counts[:, 300] = 4
    assert probability_rows({("net", "post"): counts}) == [("net", "post", 1, 4, 4)]


@pytest.mark.parametrize(("losses", "code"), [([], 0), (["2 frames"], 3)])
def test_a_drive_that_lost_a_part_of_its_log_has_exit_code_3(losses, code):
    facts = facts_of(losses=losses, totals={"net": {}})
    assert drive_row(facts, "street", "street.mcap")["exit_code"] == code


@pytest.mark.parametrize(("status", "parts"), [("scored", []), ("unscored", ["skipped"])])
def test_the_case_of_a_drive_without_a_score_is_skipped(status, parts):
    row = {"drive": "a", "seconds": 1.0, "status": status, "reason": "no truth", "verdict": ""}
    xml = junit_xml("fleet", drive_cases([row | {"losses": None}]))
    assert [part for part in ("error", "skipped") if f"<{part}" in xml.decode()] == parts
