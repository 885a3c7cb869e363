"""A fleet's folder read back: what is damaged in it is told in one line."""

import json
import os
import shutil
from dataclasses import replace

import pytest
from pyarrow import parquet

from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.tables import only
from roadeval.results.fleet import FleetFolder, FleetWriter, Made, cached_path, read_made
from roadeval.results.tables import ResultsError, read_parquet
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


@pytest.mark.parametrize("name", ["frames", "scores"])
def test_a_cached_table_that_has_gone_is_made_anew(folder, name):
    rows = FleetFolder(folder).table(name)
    drive = FleetFolder(folder).facts.drives[0].drive
    cached_path(folder, name, drive).unlink()
    if name == "frames":
        with pytest.raises(ResultsError, match="is not there; run the fleet's command again"):
            FleetFolder(folder).table(name)
    FleetWriter(folder).finish(FleetFolder(folder).facts.drives, EvaluationSettings(), {}, "")
    assert cached_path(folder, name, drive).exists()
    assert FleetFolder(folder).table(name).equals(rows)


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


def test_some_columns_are_read_alone_with_tags_and_damage_elsewhere_is_not_seen(folder):
    whole, path = FleetFolder(folder), folder / "drives.parquet"
    columns = {"drives": ["drive", "evaluated"], "scores": ["drive", "truth", "ERR"]}
    for name, chosen in columns.items():
        rows = whole.table(name)
        tags = [column for column in rows if column.startswith("tag_")]
        some = read_parquet([folder / f"{name}.parquet"], name, chosen)
        assert {*some} == {*chosen, *tags}
        assert some.equals(rows[[*some]])
        with pytest.raises(ResultsError, match=r"damaged .no column FPR"):
            read_parquet([path], "scores", ["drive", "FPR"])
    place = path.read_bytes().index(b"/camera/image")
    path.write_bytes(path.read_bytes().replace(b"/camera/image", b"/camera/imagf"))
    assert place > 0
    with pytest.raises(ResultsError, match="damaged"):
        whole.table("drives")
    assert len(read_parquet([path], "drives", columns["drives"])) == 5


def test_of_an_older_fleet_nothing_is_known_of_the_truth(folder):
    rows = FleetFolder(folder).table("scores")
    for name in ("scores", "frames"):
        for path in folder.rglob(f"{name}.parquet"):
            parquet.write_table(parquet.read_table(path, partitioning=None).drop("truth"), path)
    older = FleetFolder(folder)
    assert older.table("scores").equals(rows.assign(truth=0))
    assert {*older.table("frames")["truth"]} == {0}
    some = read_parquet([folder / "scores.parquet"], "scores", ["drive", "truth"])
    assert {*some["truth"]} == {0}


def test_a_column_that_one_of_several_files_lacks_is_damage(folder):
    paths = [folder / "first.parquet", folder / "scores.parquet"]
    parquet.write_table(parquet.read_table(paths[1]).drop("FPR"), paths[0])
    with pytest.raises(ResultsError, match=r"first\.parquet: damaged .no column FPR"):
        read_parquet(paths, "scores")


# --- How a drive's results were made: written and read back as it was -----------------------------

MADE = Made("a", "asked", {"caf\udce9.mcap": [1, 2]})
"""A file's name holds a byte that is no text."""


@pytest.fixture
def results(tmp_path):
    """The folder of a fleet with a drive whose results are there."""
    summary = tmp_path / "results" / "a" / "summary.json"
    summary.parent.mkdir(parents=True)
    summary.touch()
    MADE.write(tmp_path)
    return tmp_path / "results"


def test_what_is_read_is_what_was_written(results):
    read = read_made(results.parent, "a")
    assert read is not None
    assert replace(read, results="") == MADE


@pytest.mark.parametrize(
    ("was", "now"), [('"asked"', '"other"'), ("[1, 2]", "[]"), ('"drive": "a"', '"drive": "b"')]
)
def test_what_was_changed_is_none(results, was, now):
    path = results / "a.json"
    text = path.read_text()
    assert text.count(was) >= 1
    path.write_text(text.replace(was, now))
    assert read_made(results.parent, "a") is None


def test_a_drive_whose_results_are_others_by_now_is_none(results):
    (results / "a" / "summary.json").write_text("{}")
    assert read_made(results.parent, "a") is None


def test_a_drive_whose_summary_has_gone_is_none_but_for_one_that_failed(results):
    (results / "a" / "summary.json").unlink()
    assert read_made(results.parent, "a") is None
    failed = replace(MADE, problem="no frames")
    failed.write(results.parent)
    assert read_made(results.parent, "a") == failed
    assert read_made(results.parent, "b") is None


# --- The cache of tables, which follows from the results ------------------------------------------


def finished(folder, members=None):
    members = members or FleetFolder(folder).facts.drives
    return FleetWriter(folder).finish(members, EvaluationSettings(), {}, "")


def test_a_tag_may_be_called_as_a_column_is(tmp_path):
    folder = fleet_of(tmp_path / "f", 12)
    drives = FleetFolder(folder).facts.drives
    tagged = [replace(d, tags={"camera": "left" * (n % 2)}) for n, d in enumerate(drives)]
    assert {part.tag for part in finished(folder, tagged).strata} == {"camera"}


@pytest.fixture(scope="module")
def pictured(tmp_path_factory):
    """A fleet with pictures, and what its tables are summed up to."""
    folder = fleet_of(tmp_path_factory.mktemp("pictured") / "f", 2, pictures=2)
    return folder, finished(folder)


@pytest.mark.parametrize("table", ["frames", "regions", "scores", "worst"])
def test_a_cached_table_that_is_damaged_is_made_anew(pictured, tmp_path, table):
    folder, before = shutil.copytree(pictured[0], tmp_path / "f"), pictured[1]
    next((folder / table).rglob("*.parquet")).write_bytes(b"PAR1")
    assert finished(folder) == before
    assert len(FleetFolder(folder).table(table))


def test_results_that_are_put_in_place_of_others_are_never_taken_for_these(tmp_path):
    folder, other = (fleet_of(tmp_path / name, 2, seed) for seed, name in enumerate("fg"))
    drive = FleetFolder(folder).facts.drives[0].drive
    shutil.copytree(other / "results" / drive, folder / "results" / drive, dirs_exist_ok=True)
    assert read_made(folder, drive) is None
    shutil.copy(other / "results" / f"{drive}.json", folder / "results")
    os.utime(folder / "results" / drive / "summary.json", (0, 0))
    assert finished(folder).totals != (before := finished(other)).totals
    errors = [only(FleetFolder(f).scores, drive=drive)["ERR"] for f in (folder, other)]
    assert errors[0].tolist() == errors[1].tolist()
    assert before.frames


def test_a_link_that_leads_out_of_the_folder_is_not_followed(tmp_path):
    folder = fleet_of(tmp_path / "f", 2)
    drive = FleetFolder(folder).facts.drives[0].drive
    shutil.move(folder / "frames" / drive, tmp_path / "out")
    content = (tmp_path / "out" / "frames.parquet").read_bytes()
    (folder / "frames" / drive).symlink_to(tmp_path / "out")
    with pytest.raises(ResultsError, match="a link leads out of the fleet's folder"):
        FleetFolder(folder).table("frames")
    finished(folder)
    assert not (folder / "frames" / drive).is_symlink()
    assert (tmp_path / "out" / "frames.parquet").read_bytes() == content


def test_a_drive_whose_results_are_damaged_is_not_done(tmp_path):
    folder = fleet_of(tmp_path / "f", 2)
    drive = FleetFolder(folder).facts.drives[0].drive
    (folder / "results" / drive / "frames.csv").write_text("drive,camera\n")
    shutil.rmtree(folder / "scores" / drive)
    with pytest.raises(ResultsError, match="run the fleet's command again"):
        finished(folder)
    assert read_made(folder, drive) is None
