"""Rows that are made of sums, and what a drive's row and case say of it."""

import numpy as np
import pytest

from roadeval.evaluation.score import Scoreboard
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.rows import sum_rows
from roadeval.results.schema import OF_A_DRIVE, OF_DRIVES, TABLES, documentation


def test_a_level_with_as_many_pixels_of_road_as_of_the_rest_has_a_row():
    counts = np.zeros((2, 1 << 16), np.int64)
    counts[:, 300] = 4
    board = Scoreboard(EvaluationSettings(), ["net"], None)
    board.curves.add({("net", "post"): counts})
    assert sum_rows(board)["probabilities"] == [("net", "post", 1, 4, 4)]


# --- One schema a table: what is written, read and documented is the same -------------------------


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_every_column_has_a_name_of_its_own_and_a_line_of_documentation(table):
    assert len(set(table.names)) == len(table.names)
    for column in table.columns:
        assert column.doc
        text = documentation([table.name], "csv")
        assert f"| `{column.name}` | {column.kind} | {column.doc} |" in text


def test_every_table_begins_with_its_drive_and_camera_and_is_of_one_drive_or_of_many():
    assert {*OF_A_DRIVE, *OF_DRIVES} == {*TABLES}
    assert all(
        [n for n in table.names if n != "rank"][:2] == ["drive", "camera"]
        for table in TABLES.values()
    )
