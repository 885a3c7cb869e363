"""Which stage broke it: the numbers of each stage, and the parts of the error."""

from roadeval.data.words import DASH, MINUS
from roadeval.report.blocks import Table
from roadeval.report.sections.drive import stages
from roadeval.report.tables import stages_table
from tests.report.making import column, opened, plain_rows, some_findings, the

PARTS = {
    "filtered": {"svm": 0.3, "filter": -0.1, "post": -0.1},
    "unfiltered": {"svm": 0.3, "post": -0.15},
}


def test_each_stage_has_its_rates_and_what_it_repaired_and_spoiled():
    table = stages_table(some_findings().totals, {("filtered", "post"): (0.08, 0.02)})
    assert table.columns[3:7] == ["ERR", "FPR", "FNR", "ACC"]
    assert table.columns[7:] == ["pooled ERR", "IoU", "repaired", "spoiled"]
    rates, best = ("20.00", "21.00", "22.00", "80.00"), ("10.00", "11.00", "12.00", "90.00")
    assert plain_rows(table)[:2] == [
        ["filtered", "svm", "1,200", *rates, "21.00", "60.00", DASH, DASH],
        ["", "post", "1,200", *best, "11.00", "60.00", "8.00", "2.00"],
    ]
    assert [cell.bold for cell in column(table, "ERR")] == [False, True, False, True, True]
    assert table.breaks == [2, 4]
    assert list(table.text_columns) == [0, 1]


def test_the_parts_of_the_error_add_up_to_it():
    parts = the(Table, stages(some_findings(error_parts=PARTS)))
    assert parts.columns == ["final mask", "svm", "filter", "post", "ERR"]
    assert plain_rows(parts) == [
        ["filtered", "30.00", f"{MINUS}10.00", f"{MINUS}10.00", "10.00"],
        ["unfiltered", "30.00", DASH, f"{MINUS}15.00", "15.00"],
    ]


def test_an_oracle_shows_what_would_change():
    row = {"variant": "filtered", "oracle": "svm", "as_is": 0.1, "frames": 1200}
    oracles = [row | {"ERR": 0.04, "FPR": 0.05, "FNR": 0.06}]
    findings = some_findings(error_parts=PARTS, oracles=oracles)
    *_, table = (block for block in opened(stages(findings)) if isinstance(block, Table))
    assert plain_rows(table) == [
        ["filtered", "perfect svm", "10.00", "4.00", f"{MINUS}6.00", "5.00", "6.00", "1,200"]
    ]
