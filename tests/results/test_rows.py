"""Rows that are made of sums, and what a drive's row and case say of it."""

import numpy as np
import pytest

from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.score import Scoreboard
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.rows import drive_row, score_rows, sum_rows
from roadeval.results.schema import OF_A_DRIVE, OF_DRIVES, TABLES, Kind, documentation
from tests.results.making import facts_of


def test_a_level_with_as_many_pixels_of_road_as_of_the_rest_has_a_row():
    counts = np.zeros((2, 1 << 16), np.int64)
    counts[:, 300] = 4
    board = Scoreboard(EvaluationSettings(), ["net"], None)
    board.curves.add({("net", "post"): counts})
    assert sum_rows(board)["probabilities"] == [("net", "post", 1, 4, 4)]


@pytest.mark.parametrize(("losses", "code"), [([], 0), (["2 frames"], 3)])
def test_a_drive_that_lost_a_part_of_its_log_has_exit_code_3(losses, code):
    facts = facts_of(losses=losses, totals={"net": {}})
    assert drive_row(facts, "street", "street.mcap")["exit_code"] == code


def test_scores_of_a_final_mask_have_its_edge_flicker_and_episodes():
    beyond = {
        "boundary_F": 0.5,
        "boundary_IoU": 0.4,
        "flicker": 0.2,
        "truth_flicker": 0.1,
        "episodes": {"episodes": 3, "seconds": 1.5, "recovered": 2},
    }
    totals = {"net": {"raw": {"ERR": 0.3}, "post": {"ERR": 0.2}}}
    raw, post = score_rows(facts_of(totals=totals, beyond={"net": beyond}), {})
    further = {
        "boundary_f": 0.5,
        "boundary_iou": 0.4,
        "episodes": 3,
        "episode_seconds": 1.5,
        "flicker": 0.2,
        "truth_flicker": 0.1,
    }
    assert raw == {"variant": "net", "stage": "raw", "final": False, "region": "all", "ERR": 0.3}
    assert post == raw | {"stage": "post", "final": True, "ERR": 0.2} | further


# --- One schema a table: what is written, read and documented is the same -------------------------


@pytest.mark.parametrize("name", ["frames", "oracles", "windows"])
def test_every_metric_is_a_column(name):
    rates = [column.name for column in TABLES[name].columns if column.kind is Kind.RATE]
    assert rates[: len(METRICS)] == list(METRICS)


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
