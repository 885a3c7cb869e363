"""One schema a table: what is written, read and documented is the same."""

import pytest

from roadeval.evaluation.metrics import METRICS
from roadeval.results.schema import OF_A_DRIVE, OF_DRIVES, STREAMED, TABLES, Kind, documentation


def test_the_tables_that_grow_frame_by_frame():
    streamed = ["frames", "regions", "oracles", "disagreements", "unlabelled", "edges"]
    assert list(STREAMED) == streamed


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


def test_the_documentation_is_a_markdown_table_a_table():
    text = documentation(TABLES, "csv").splitlines()
    for name in TABLES:
        assert f"### {name}.csv" in text


def test_every_table_begins_with_its_drive_and_camera_and_is_of_one_drive_or_of_many():
    assert {*OF_A_DRIVE, *OF_DRIVES} == {*TABLES}
    assert all(
        [n for n in table.names if n != "rank"][:2] == ["drive", "camera"]
        for table in TABLES.values()
    )
