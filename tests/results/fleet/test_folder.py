"""A fleet's folder read back: what is damaged in it is told in one line."""

import json
import shutil

import pyarrow as pa
import pytest
from pyarrow import parquet

from roadeval import Result
from roadeval.results.fleet import (
    FleetFolder,
    Record,
    frames_path,
    read_record,
    record_path,
)
from roadeval.results.rows import Key, cells
from roadeval.results.schema import OF_DRIVES
from roadeval.results.tables import ResultsError
from tests.results.fleet.making import fleet_of


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return fleet_of(tmp_path_factory.mktemp("fleets") / "week", 5)


@pytest.fixture
def folder(made, tmp_path):
    return shutil.copytree(made, tmp_path / "week")


def change(path, **parts):
    path.write_text(json.dumps(json.loads(path.read_text()) | parts))


@pytest.mark.parametrize(
    ("part", "other"), [("verdict", "Better."), ("counts", {}), ("frames", 5), ("totals", {})]
)
def test_a_result_that_was_changed_is_damage(folder, part, other):
    change(folder / "fleet.json", **{part: other})
    with pytest.raises(ResultsError, match=r"fleet\.json: damaged .its content is not what was"):
        FleetFolder(folder)


@pytest.mark.parametrize("part", ["drives", "effects", "strata"])
@pytest.mark.parametrize("value", [None, 5, {}, [5]])
def test_a_part_of_another_shape_is_damage(folder, part, value):
    change(folder / "fleet.json", **{part: value, "digest": None})
    with pytest.raises(ResultsError, match=f"damaged .`{part}` is not what it must be"):
        FleetFolder(folder)


def test_damage_is_mended_by_the_same_command(folder):
    change(folder / "fleet.json", verdict="Better.")
    with pytest.raises(ResultsError, match="run the fleet's command again"):
        FleetFolder(folder)
    assert FleetFolder(fleet_of(folder, 5)).facts.verdict != "Better."
    (folder / "fleet.json").write_text("{")
    assert len(FleetFolder(fleet_of(folder, 5)).facts.drives) == 5


def test_another_version_s_folder_is_not_written_to(folder):
    change(folder / "fleet.json", format={"name": "roadeval-fleet", "version": 9})
    with pytest.raises(ResultsError, match=r"made by roadeval .*, a later version"):
        fleet_of(folder, 5)


def test_a_damaged_table_of_frames_says_what_makes_it_anew(folder):
    drive = Result(folder).drives.query("status == 'scored'").drive.iloc[0]
    path = folder / "frames" / drive / "frames.parquet"
    column = parquet.ParquetFile(path).metadata.row_group(0).column(0)
    begin = column.dictionary_page_offset or column.data_page_offset
    content = bytearray(path.read_bytes())
    content[begin + column.total_compressed_size - 1] ^= 1
    path.write_bytes(content)
    remedy = f"remove .*records/{drive}.json and run the fleet's command again"
    with pytest.raises(ResultsError, match=remedy):
        FleetFolder(folder).frames(drive)
    words = pa.table({name: ["x"] for name in parquet.read_schema(path).names})
    parquet.write_table(words, path)
    with pytest.raises(ResultsError, match="column frame is not of type int64"):
        FleetFolder(folder).frames(drive)


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
            FleetFolder(folder).table(table)


# --- The record of a drive: written and read back as it was ---------------------------------------


def write(folder):
    """Write a record whose drive has frames, and a file with a name that is no text."""
    row = {"drive": "a", "evaluated": 100}
    rows = {name: [] for name in OF_DRIVES} | {"drives": cells("drives", Key("a", ""), [row])}
    made = Record("a", "asked", {"caf\udce9.mcap": [1, 2]}, rows)
    (folder / "records").mkdir()
    made.write(folder)
    return made


def test_a_file_s_name_that_is_no_text_comes_back(tmp_path):
    made = write(tmp_path)
    read = read_record(tmp_path, "a")
    assert read is not None
    assert read.stamp == made.stamp


@pytest.mark.parametrize(("was", "now"), [(" 100,", " 900,"), (" 100,", ' "1",'), ("[1, 2]", "[]")])
def test_a_record_that_was_changed_is_none(tmp_path, was, now):
    write(tmp_path)
    path = record_path(tmp_path, "a")
    text = path.read_text()
    assert text.count(was) == 1
    path.write_text(text.replace(was, now))
    assert read_record(tmp_path, "a") is None


def test_a_drive_is_whole_where_its_summary_and_the_frames_that_it_has_are_there(tmp_path):
    made = write(tmp_path)
    summary, frames = tmp_path / "results" / "a" / "summary.json", frames_path(tmp_path, "a")
    summary.parent.mkdir(parents=True)
    summary.touch()
    assert not made.is_whole(tmp_path)
    frames.parent.mkdir(parents=True)
    frames.touch()
    assert made.is_whole(tmp_path)
