"""A fleet's folder read back: what is damaged in it is told in one line."""

import json
import shutil

import pyarrow as pa
import pytest
from pyarrow import parquet

from roadeval import Fleet
from roadeval.results.reading import ResultsError
from tests.results.fleet.making import fleet_of


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return fleet_of(tmp_path_factory.mktemp("fleets") / "week", 5)


@pytest.fixture
def folder(made, tmp_path):
    return shutil.copytree(made, tmp_path / "week")


def change(path, **parts):
    path.write_text(json.dumps(json.loads(path.read_text()) | parts))


def test_what_was_written_is_read(folder):
    fleet = Fleet(folder)
    assert len(fleet.drives) == len(fleet.summary["drives"]) == 5


@pytest.mark.parametrize("part", ["verdict", "counts", "frames", "rates", "effects", "strata"])
def test_a_result_that_was_changed_is_damage(folder, part):
    told = json.loads((folder / "fleet.json").read_text())[part]
    change(folder / "fleet.json", **{part: told[1:] if isinstance(told, list) else 5})
    with pytest.raises(ResultsError, match=r"fleet\.json: damaged .its numbers are not those that"):
        Fleet(folder)


def test_where_the_drives_lie_may_change(folder):
    told = json.loads((folder / "fleet.json").read_text())["drives"]
    change(folder / "fleet.json", drives=[{**row, "source": "elsewhere"} for row in told])
    assert Fleet(folder).summary["drives"][0]["source"] == "elsewhere"


@pytest.mark.parametrize("part", ["drives", "rates", "effects", "strata", "conditions"])
@pytest.mark.parametrize("value", [None, 5, {}, [5]])
def test_a_part_of_another_shape_is_damage(folder, part, value):
    change(folder / "fleet.json", **{part: value, "digest": None})
    with pytest.raises(ResultsError, match=f"damaged .`{part}` is not what it must be"):
        Fleet(folder)


@pytest.mark.parametrize("table", ["drives", "scores", "effects"])
def test_a_flipped_bit_in_a_table_s_page_is_damage(folder, table):
    path = folder / f"{table}.parquet"
    pages = parquet.ParquetFile(path).metadata.row_group(0)
    content = path.read_bytes()
    for number in range(pages.num_columns):
        column = pages.column(number)
        begin = column.dictionary_page_offset or column.data_page_offset
        last = begin + column.total_compressed_size - 1
        path.write_bytes(content[:last] + bytes([content[last] ^ 1]) + content[last + 1 :])
        with pytest.raises(ResultsError, match=rf"{table}\.parquet: damaged"):
            Fleet(folder).table(table)


def test_a_column_of_another_type_is_damage(folder):
    path = folder / "scores.parquet"
    table = parquet.read_table(path)
    at = table.column_names.index("TP")
    words = table.set_column(at, "TP", pa.array(["many"] * len(table)))
    parquet.write_table(words, path)
    with pytest.raises(ResultsError, match="column TP is not of type int64"):
        Fleet(folder).table("scores")
