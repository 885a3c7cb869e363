"""A fleet's folder read back: what is damaged in it is told in one line."""

import json
import shutil

import pyarrow as pa
import pytest
from pyarrow import parquet

from roadeval import Result
from roadeval.results.fleet import FleetFolder, recording_path
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


def test_what_was_written_is_read(folder):
    fleet = Result(folder)
    assert len(fleet.drives) == len(fleet.summary["drives"]) == 5


@pytest.mark.parametrize(
    ("part", "other"), [("verdict", "Better."), ("counts", {}), ("frames", 5), ("rates", [])]
)
def test_a_result_that_was_changed_is_damage(folder, part, other):
    change(folder / "fleet.json", **{part: other})
    with pytest.raises(ResultsError, match=r"fleet\.json: damaged .its content is not what was"):
        FleetFolder(folder)


def test_where_the_drives_lie_may_change(folder):
    told = json.loads((folder / "fleet.json").read_text())["drives"]
    change(folder / "fleet.json", drives=[{**row, "source": "elsewhere"} for row in told])
    assert FleetFolder(folder).facts.drives[0].source == "elsewhere"


@pytest.mark.parametrize("part", ["drives", "rates", "effects", "strata", "conditions"])
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
    path = folder / "frames" / f"drive={drive}" / "frames.parquet"
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


def test_a_footer_that_arrow_does_not_understand_is_damage(folder, monkeypatch):
    def fail(*_, **__):
        raise pa.ArrowNotImplementedError("unknown encoding")

    monkeypatch.setattr(parquet.ParquetFile, "read", fail)
    with pytest.raises(ResultsError, match=r"damaged \(unknown encoding\); run the fleet"):
        FleetFolder(folder).table("scores")


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


def test_a_column_of_another_type_is_damage(folder):
    path = folder / "scores.parquet"
    table = parquet.read_table(path)
    at = table.column_names.index("TP")
    words = table.set_column(at, "TP", pa.array(["many"] * len(table)))
    parquet.write_table(words, path)
    with pytest.raises(ResultsError, match="column TP is not of type int64"):
        FleetFolder(folder).table("scores")


def test_a_worst_frame_whose_recording_was_not_kept_opens_where_its_log_is_trusted(folder):
    fleet = FleetFolder(folder)
    first = fleet.worst[0]
    assert fleet.inspect(first).endswith("--worst 1 --trust-sources")
    kept = recording_path(folder, first["drive"])
    kept.parent.mkdir(exist_ok=True)
    kept.touch()
    assert fleet.inspect(first).endswith("--worst 1")
