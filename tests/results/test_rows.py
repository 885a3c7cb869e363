"""Rows that are made of sums, and of many drives; the schema that all tables follow."""

import numpy as np
import pytest

from roadeval.data import Counts
from roadeval.evaluation import metrics
from roadeval.evaluation.score.scoreboard import Scoreboard
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.tables import joined, windows
from roadeval.results.rows import scores, sum_rows
from roadeval.results.schema import OF_A_DRIVE, OF_DRIVES, TABLES, documentation
from tests.evaluation.making import a_table, table_of
from tests.results.making import KEY

NOTHING = table_of("frames", [])


def test_a_level_with_as_many_pixels_of_road_as_of_the_rest_has_a_row():
    counts = np.zeros((2, 1 << 16), np.int64)
    counts[:, 300] = 4
    board = Scoreboard(KEY, EvaluationSettings(), ["net"], None)
    board.curves.add({("net", "post"): counts})
    rows = sum_rows(board, windows(NOTHING, 10))
    assert rows.pop("probabilities") == [("net", "post", 1, 4, 4)]
    assert not any(rows.values())


# --- Scores of any number of drives ---------------------------------------------------------------


def of_region(frame, n, region="lit", **key):
    """A row of ``regions`` with ``n`` of 10 pixels wrong; of 0 pixels for -1."""
    counts = {"TP": 5, "TN": 5 - n, "FP": n, "FN": 0, "N": 10}
    counts = counts if n >= 0 else dict.fromkeys(counts, 0)
    return {"frame": frame, "variant": "net", "stage": "post", "region": region, **counts, **key}


def test_each_mask_has_a_row_of_its_own_on_all_pixels_and_one_of_each_region():
    masks = {("net", "svm"): [20, 40], ("net", "post"): [10, 30]}
    frames = joined([a_table(masks), a_table({("net", "svm"): [50]}, drive="road")])
    regions = table_of("regions", [of_region(0, 2), of_region(1, -1), of_region(0, 1, "far")])
    known = {"variant": "net", "boundary_f": 0.7, "drive": "street", "camera": KEY.camera}
    rows = scores(frames, regions, [known])
    assert [*rows] == [*TABLES["scores"].names]
    shown = rows[["drive", "stage", "region", "final", "frames", "ERR"]].to_numpy().tolist()
    assert shown == [
        ["street", "svm", "all", False, 2, pytest.approx(0.3)],
        ["street", "post", "all", True, 2, pytest.approx(0.2)],
        ["street", "post", "lit", True, 1, pytest.approx(0.2)],
        ["street", "post", "far", True, 1, pytest.approx(0.1)],
        ["road", "svm", "all", True, 1, pytest.approx(0.5)],
    ]
    assert rows["boundary_f"].fillna(-1).tolist() == [-1, 0.7, -1, -1, -1]
    pooled = metrics.of(Counts(tp=100, tn=60, fp=40))
    assert rows["pooled_FPR"].iloc[1] == pooled["FPR"]


def test_nothing_scored_has_no_scores():
    rows = scores(NOTHING, table_of("regions", []), [])
    assert rows.empty
    assert [*rows] == [*TABLES["scores"].names]


# --- One schema a table: what is written, read and documented is the same -------------------------


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_every_column_has_a_name_of_its_own_and_a_line_of_documentation(table):
    assert len(set(table.names)) == len(table.names)
    for column in table.columns:
        assert column.doc
        text = documentation([table.name], "csv")
        assert f"| `{column.name}` | {column.kind} | {column.unit} | {column.doc} |" in text


def test_every_table_begins_with_its_drive_and_camera_and_is_of_one_drive_or_of_many():
    assert {*OF_A_DRIVE, *OF_DRIVES} == {*TABLES}
    assert all(
        [n for n in table.names if n != "rank"][:2] == ["drive", "camera"]
        for table in TABLES.values()
    )
