"""The tables of errors in metres: what they mark as unsure."""

from typing import Any

import numpy as np
import pandas as pd

from roadeval.report.blocks import plain
from roadeval.report.sections.ground import UNSURE, distance_table
from tests.report.making import some_findings

NAMES = ["filtered", "unfiltered"]


def row(variant: str, measure: str, where: str, value: float, sway: float) -> dict[str, Any]:
    own = {"variant": variant, "measure": measure, "where": where, "frames": 9, "missing": 1}
    return own | {"value": value, "p95": 0.5, "low": value - sway, "high": value + sway / 2}


def test_a_difference_that_a_wrong_camera_could_explain_is_marked():
    rows = [
        row("filtered", "ERR", "0-10m", 0.10, 0.02),
        row("filtered", "ERR", "from_above", 0.10, 0.02),
        row("unfiltered", "ERR", "0-10m", 0.13, 0.05),
        row("unfiltered", "ERR", "from_above", 0.11, 0.05),
    ]
    first, ranges, second, *_ = distance_table(rows, NAMES).rows
    assert [plain(cell) for cell in first[1:3]] == ["10.0", f"{UNSURE}10.0"]
    assert plain(ranges[1]) == "8.0\N{EN DASH}11.0"
    assert [plain(cell) for cell in second[1:3]] == ["13.0", "11.0"]
    brief = distance_table(rows, NAMES, brief=True)
    assert brief.columns == ["ERR, %", "0\N{EN DASH}10 m", "by area"]
    assert [plain(cell) for cell in brief.rows[0][1:]] == ["10.0", f"{UNSURE}10.0"]
    assert f"{UNSURE}: a camera that stands" in brief.caption


def test_an_interval_of_errors_ends_at_what_an_error_can_be():
    wrong = np.arange(40) % 20 == 0  # one frame in twenty, all of it
    words = {"variant": "filtered", "stage": "post", "region": "0-10m"}
    rows = pd.DataFrame({**words, "N": 9, "FP": 9 * wrong, "FN": 0})
    found = some_findings(table=lambda _: rows).by_distance
    mean, low, high = found["0-10m", "filtered"]
    assert (mean, low) == (0.05, 0.0)
    assert 0.05 < high < 1
