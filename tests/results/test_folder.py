"""The results folder and its facts: what is written is read, and nothing half-done stays."""

import gzip
import hashlib
import json
import math
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pyarrow import parquet

from roadeval.data import FrameResult, Packed, Role
from roadeval.evaluation.score.frame import BlindPrior
from roadeval.evaluation.score.scoreboard import Scoreboard
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.tables import only
from roadeval.geometry.ground import ground_of
from roadeval.geometry.settings import GroundSettings
from roadeval.results import tables
from roadeval.results.facts import Facts, FrameAccount, LogFacts, digest_of
from roadeval.results.fleet import FleetFolder, FleetWriter, Made, cached_path, read_made
from roadeval.results.folder import ResultsFolder, ResultsWriter, names_of_results
from roadeval.results.schema import OF_A_DRIVE as ALL_TABLES
from roadeval.results.schema import TABLES
from roadeval.results.tables import FLEET_FORMAT, ResultsError, made_of, read_parquet
from tests.evaluation.making import a_frame, a_variant, pixels
from tests.evaluation.test_scoreboard import effects_of
from tests.results.fleet.making import fleet_of
from tests.results.making import KEY, facts_of, lines, sum_lines

TRUTHS = [pixels("##..", "##.?"), pixels("....", "...."), pixels("###.", "....")]
MASK = pixels("#.#.", "##..")
RUN_TOML = 'preset = "paper"\n'
OF_A_DRIVE = [name for name in ALL_TABLES if name != "unlabelled"]
"""Those of a drive whose every frame has truth."""


def a_board() -> Scoreboard:
    settings = EvaluationSettings(window=2, boundary_width=1, bands=2)
    ground, _ = ground_of(None, GroundSettings(height=1.5, pitch=30, fov=60), (4, 2))
    return Scoreboard(KEY, settings, ["filtered"], BlindPrior.of_truths(TRUTHS), ground)


def scored(board: Scoreboard, role: Role = Role.EVALUATED) -> Iterator[FrameResult]:
    variant = a_variant("filtered", {"post": MASK}, {"shadow": MASK})
    variant = replace(variant, oracles={"svm": {"post": Packed.of(MASK)}})
    (stage,) = variant.stages
    graded = replace(stage.output, probability=MASK.astype(np.uint16) * 40_000)
    variant = replace(variant, stages=(replace(stage, output=graded),))
    for number, truth in enumerate(TRUTHS):
        classes = np.where(truth == 1, 0, 1 + np.arange(4) % 2).astype(np.uint8)
        frame = replace(a_frame(truth, number + 5), classes=classes)
        result = board.score(frame, role, (variant,))
        if role is Role.EVALUATED:
            result = replace(result, disturbed={"fog:2": result})
        board.add(result)
        yield result


def the_rest(board: Scoreboard) -> Facts:
    """Facts with the board's parts, and empty ones for those that it does not know."""
    account, sums = FrameAccount(evaluated=board.roles().get(Role.EVALUATED, 0)), board.summary()
    return facts_of(frames=account, effects=sums.effects, **sums.parts)


def write(folder: Path, role: Role = Role.EVALUATED, *, packed: bool = False) -> list[Path]:
    board = a_board()
    with ResultsWriter(folder, packed=packed) as writer:
        for result in scored(board, role):
            writer.append(lines(result))
        writer.append(sum_lines(board, board.summary().windows))
        files = writer.finish(the_rest(board), RUN_TOML).files
    return [folder / name for name in files]


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


OF = "street,/camera/image,"


def test_an_undefined_rate_is_an_empty_cell_and_reads_back_as_undefined(tmp_path: Path) -> None:
    write(tmp_path)
    line = (tmp_path / "frames.csv").read_text().splitlines()[3]
    assert line.startswith(f"{OF}6,600000000,600000007,filtered,post,0,4,4,0,8,0.5,0.5,,,0.5,0.5,")
    assert math.isnan(ResultsFolder(tmp_path).table("frames").loc[2, "TPR"])


@pytest.mark.parametrize("finished", [False, True])
def test_an_interrupted_run_leaves_the_earlier_results(tmp_path: Path, *, finished: bool) -> None:
    write(tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    board = a_board()
    with suppress(KeyboardInterrupt), ResultsWriter(tmp_path) as writer:
        writer.append(lines(next(scored(board))))
        if finished:
            writer.finish(the_rest(board), RUN_TOML)
        raise KeyboardInterrupt
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_the_next_run_s_files_are_all_that_is_left_of_results_and_others_stay(
    tmp_path: Path,
) -> None:
    board = a_board()
    with ResultsWriter(tmp_path) as writer:
        (writer.folder / "fig9_weather.png").write_text("of this run alone")
        writer.append(lines(next(scored(board))))
        writer.finish(the_rest(board), RUN_TOML)
    (tmp_path / "notes.txt").write_text("mine")
    assert {"fig9_weather.png", "frames.csv", "notes.txt"} < names(tmp_path)
    written = {path.name for path in write(tmp_path)}
    assert names(tmp_path) == {*written, "notes.txt"}
    assert ResultsFolder(tmp_path).facts.files == sorted(written)


@pytest.mark.parametrize(
    "listed",
    [["../notes.txt", "/etc", "..", ".", 5, "a\0b", "\ud800x", 300 * "x"], "notes", {"a": 1}, None],
)
def test_a_summary_names_no_file_elsewhere_as_a_result(tmp_path: Path, listed: Any) -> None:
    write(tmp_path / "results")
    path = tmp_path / "results" / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"files": listed}))
    assert not names_of_results(path) & {"notes.txt", "..", ".", "n", "a", "/etc"}
    (tmp_path / "results" / "folder").mkdir()
    for name in ("notes.txt", "results/n", "results/a"):
        (tmp_path / name).write_text("mine")
    write(tmp_path / "results")
    assert {"n", "a"} < names(tmp_path / "results")
    assert names(tmp_path) == {"results", "notes.txt"}


@pytest.mark.parametrize("table", OF_A_DRIVE)
def test_a_table_that_was_cut_or_taken_away_is_refused(tmp_path: Path, table: str) -> None:
    write(tmp_path)
    path = tmp_path / f"{table}.csv"
    lines = path.read_text().splitlines(keepends=True)
    for left, cut in (
        (len(lines) - 2, lambda: path.write_text("".join(lines[:-1]))),
        (0, path.unlink),
    ):
        cut()
        with pytest.raises(ResultsError) as caught:
            ResultsFolder(tmp_path).table(table)
        agreed = f"does not agree with its summary ({left} of {len(lines) - 1} rows)"
        again = "make the results again with roadeval replay"
        assert str(caught.value) == f"{path}: {agreed}; {again}"


def test_a_folder_without_results_says_where_some_are(tmp_path: Path) -> None:
    def told() -> str:
        with pytest.raises(ResultsError) as caught:
            ResultsFolder(tmp_path)
        return str(caught.value)

    missing = f"{tmp_path}: no results here (summary.json: No such file or directory); "
    assert told() == f"{missing}make some with roadeval replay, or roadeval fleet"
    write(tmp_path / "monday")
    assert told() == f"{missing}name a folder in it, as {tmp_path / 'monday'}"
    (tmp_path / "results").mkdir()
    assert told().endswith("that was stopped, give the same roadeval fleet command again")


def test_a_table_with_one_number_changed_is_refused(tmp_path: Path) -> None:
    write(tmp_path)
    path = tmp_path / "heat.csv"
    path.write_text(path.read_text().replace("filtered,0,0,8,23", "filtered,0,0,8,24"))
    with pytest.raises(ResultsError, match=r"summary \(its content differs\)"):
        ResultsFolder(tmp_path).table("heat")


def test_packed_results_are_the_same_results(tmp_path: Path) -> None:
    write(tmp_path / "plain")
    for folder in ("packed", "again"):
        write(tmp_path / folder, packed=True)
    plain, packed = (ResultsFolder(tmp_path / name) for name in ("plain", "packed"))
    assert packed.facts.tables == plain.facts.tables
    for table in OF_A_DRIVE:
        content = (tmp_path / "packed" / f"{table}.csv.gz").read_bytes()
        assert gzip.decompress(content) == (tmp_path / "plain" / f"{table}.csv").read_bytes()
        assert content == (tmp_path / "again" / f"{table}.csv.gz").read_bytes()
        assert content[4:8] == bytes(4)  # the time of writing
        pd.testing.assert_frame_equal(packed.table(table), plain.table(table))
    assert not list((tmp_path / "packed").glob("*.csv"))
    texts = [(tmp_path / name / "summary.json").read_text() for name in ("packed", "plain")]
    summaries = [json.loads(text) | {"files": None} for text in texts]
    assert summaries[0] == summaries[1]
    assert texts[0].count("\n") == 1
    assert len(texts[0]) < 0.8 * len(texts[1])


def test_plain_results_replace_packed_ones_and_packed_ones_plain_ones(tmp_path: Path) -> None:
    for packed in (True, False, True):
        files = write(tmp_path, packed=packed)
        assert names(tmp_path) == {path.name for path in files}


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda content: content[:-9], "end-of-stream marker"),
        (lambda content: content[:40] + bytes(9) + content[49:], "damaged"),
        (lambda content: content[:-4] + b"abcd", "length"),
        (lambda _: b"frame,drive\n", "Not a gzipped file"),
        (lambda _: gzip.compress(bytes(3_000_000)), "it unpacks to more than"),
    ],
)
def test_a_damaged_packed_table_is_one_line(
    damage: Callable[[bytes], bytes], reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "UNPACKED", 1 << 20)
    write(tmp_path, packed=True)
    path = tmp_path / "frames.csv.gz"
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(ResultsError) as caught:
        ResultsFolder(tmp_path).table("frames")
    assert str(caught.value).startswith(f"{path}: damaged (")
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_summary_states_what_sha256sum_says(tmp_path: Path) -> None:
    write(tmp_path)
    stated = ResultsFolder(tmp_path).facts.tables
    assert list(stated) == list(OF_A_DRIVE)
    for name, told in stated.items():
        content = (tmp_path / f"{name}.csv").read_bytes()
        assert told.sha256 == hashlib.sha256(content).hexdigest()
        assert told.rows == len(ResultsFolder(tmp_path).table(name))


def test_a_run_that_scored_nothing_writes_no_tables_and_leaves_no_older_ones(
    tmp_path: Path,
) -> None:
    write(tmp_path)
    assert [path.name for path in write(tmp_path, Role.TRAINING)] == ["run.toml", "summary.json"]
    assert names(tmp_path) == {"run.toml", "summary.json"}
    assert ResultsFolder(tmp_path).table("frames").empty
    assert "ERR" in ResultsFolder(tmp_path).table("frames")


def test_a_folder_that_cannot_be_written_is_one_line_with_a_remedy(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(ResultsError, match=r"cannot be written: .*with `output\.reports`") as caught,
        ResultsWriter(tmp_path / "file"),
    ):
        pass
    assert "\n" not in str(caught.value)


NAMES = ("filtered", "unfiltered", "net", "net_tuned", "blind")
TOTALS = {name: {"post": {"ERR": 0.1, "frames": 100}} for name in NAMES}
EFFECTS = effects_of({(name, "post"): [3] * 12 for name in NAMES})
WRITTEN = facts_of(
    totals=TOTALS,
    claims={"filter_ERR": {"held": 2}},
    run={"output": {"save": "out.rrd"}, "evaluation": {"window": 7, "from_the_future": 1}},
    log=LogFacts("street.mcap", "abc"),
    effects=EFFECTS,
)


def changed(**parts):
    """The text of a summary with other parts, under the digest of the first ones."""
    return json.dumps(json.loads(WRITTEN.text()) | parts)


def sealed(content):
    digest = digest_of(content, content["digest"]["parts"])
    return json.dumps(content | {"digest": digest})


def test_what_is_read_is_what_was_written():
    assert Facts.parse(WRITTEN.text(), "here") == WRITTEN
    assert Facts.parse(WRITTEN.text(), "here").effects == EFFECTS


def test_undefined_numbers_are_null_and_read_as_undefined():
    (effect,) = (e for e in EFFECTS if (e.base, e.variant) == ("unfiltered", "filtered"))
    nothing = replace(effect.rates["ERR"], mean=math.nan, units=0)
    facts = replace(WRITTEN, effects=[replace(effect, rates={"ERR": nothing})])
    written = json.loads(facts.text())
    assert written["difference"]["post"]["ERR"]["mean"] is None
    (read,) = Facts.parse(facts.text(), "here").effects
    assert math.isnan(read.rates["ERR"].mean)
    assert replace(read.rates["ERR"], mean=0) == replace(nothing, mean=0)


def test_each_difference_is_under_what_is_subtracted_too():
    content = json.loads(WRITTEN.text())
    assert [*content["difference"]] == ["post"]
    parts = {part: [*content[f"against_{part}"]] for part in ("unfiltered", "blind", "method")}
    assert parts == {
        "unfiltered": ["net", "net_tuned"],
        "blind": ["filtered", "unfiltered", "net", "net_tuned"],
        "method": ["net_tuned"],
    }


@pytest.mark.parametrize("given", [{"confidence": 2}, {"window": None}, 5, None])
def test_damaged_settings_are_one_line(given):
    with pytest.raises(ResultsError, match=r"`run.evaluation` is not what it must be"):
        _ = facts_of(run={"evaluation": given}).evaluation


@pytest.mark.parametrize(
    ("summary", "told"),
    [
        (
            {"format": {**Facts.FORMAT, "version": 1}},
            "made by an earlier version of roadeval in a format",
        ),
        (
            {"format": {**Facts.FORMAT, "version": 2}, "versions": {"roadeval": "0.2.0"}},
            "made by roadeval 0.2.0 in a format",
        ),
        ({"format": {**Facts.FORMAT, "version": 99}}, "made by a later version: update roadeval"),
        ({"format": {**Facts.FORMAT, "version": "x"}}, "not of format roadeval-summary"),
        ([3], "not of format roadeval-summary"),
    ],
)
def test_a_summary_of_another_format_is_refused_with_who_wrote_it(summary, told):
    with pytest.raises(ResultsError) as caught:
        Facts.parse(json.dumps(summary), "old.rrd")
    assert str(caught.value).startswith(f"old.rrd: {told}")


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("totals", {"blind": 5}),
        ("totals", {"filtered": {"post": None}}),
        ("seconds", {"filtered": 1.5}),
        ("settings", -1),
        ("tables", {"frames": 1.5}),
        ("run", []),
        ("drive", {}),
        ("frames", {"evaluated": "many"}),
        ("difference", {"post": {"ERR": {"mean": "high"}}}),
        ("cameras", []),
        ("cameras", {"left": "no facts"}),
        *((part, ...) for part in ("verdict", "frames", "totals", "difference")),
    ],
)
def test_a_part_that_is_not_there_or_of_another_shape_is_damage(part, value):
    content = json.loads(changed(**{part: None if value is ... else value}))
    if value is ...:
        del content[part]
    with pytest.raises(ResultsError, match=f"here: damaged .`{part}` is not what it must be"):
        Facts.parse(json.dumps(content), "here")


def test_a_number_that_was_changed_is_damage():
    other = {**TOTALS, "filtered": {"post": {"ERR": 0.3, "frames": 100}}}
    without = {key: part for key, part in json.loads(WRITTEN.text()).items() if key != "claims"}
    for text in (changed(totals=other), json.dumps(without)):
        with pytest.raises(ResultsError, match=r"here: damaged \(its content is not what was"):
            Facts.parse(text, "here")


def test_where_files_lie_may_change():
    moved = Facts.parse(changed(run={"output": {"save": "elsewhere.rrd"}}), "here")
    assert moved.run["output"]["save"] == "elsewhere.rrd"


@pytest.mark.parametrize("digest", ["x", {}, {"parts": 5, "sha256": ""}, {"parts": [[]]}])
def test_a_damaged_digest_is_damage(digest):
    with pytest.raises(ResultsError, match="here: damaged"):
        Facts.parse(changed(digest=digest), "here")


def test_parts_that_a_later_version_covers_are_checked_by_this_one():
    content = json.loads(WRITTEN.text()) | {"new": [1, 2]}
    content["digest"]["parts"].append("new")
    assert Facts.parse(sealed(content), "here") == WRITTEN
    with pytest.raises(ResultsError, match="damaged"):
        Facts.parse(json.dumps(json.loads(sealed(content)) | {"new": [1, 3]}), "here")


# --- A fleet's folder read back: what is damaged in it is told in one line ------------------------


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
def test_a_result_that_was_changed_is_damage_which_the_same_command_mends(folder, part, other):
    change(folder / "fleet.json", **{part: other})
    told = r"fleet\.json: damaged .its content is not what was.*run the fleet's command again"
    with pytest.raises(ResultsError, match=told):
        FleetFolder(folder)
    assert FleetFolder(fleet_of(folder, 5)).facts.verdict != "Better."


@pytest.mark.parametrize("part", ["drives", "effects", "strata"])
@pytest.mark.parametrize("value", [None, 5, {}, [5]])
def test_a_part_of_a_fleet_of_another_shape_is_damage(folder, part, value):
    change(folder / "fleet.json", **{part: value, "digest": None})
    with pytest.raises(ResultsError, match=f"damaged .`{part}` is not what it must be"):
        FleetFolder(folder)


def test_a_file_that_is_no_fleet_is_mended_by_the_same_command(folder):
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


def test_each_table_states_its_format_and_what_it_was_made_of_and_a_new_cache_stays(folder):
    paths = [*folder.glob("*.parquet"), *folder.glob("*/*/*.parquet")]
    for path in paths:
        stated = parquet.read_metadata(path).metadata
        assert json.loads(stated[b"roadeval"]) == FLEET_FORMAT
        assert stated[b"about"].decode() == TABLES[path.stem].doc
        if path.parent != folder:
            summary = folder / "results" / path.parent.name / "summary.json"
            assert made_of(path) == hashlib.sha256(summary.read_bytes()).hexdigest()
    inodes = [path.stat().st_ino for path in folder.glob("*/*/*.parquet")]
    FleetWriter(folder).finish(FleetFolder(folder).facts.drives, EvaluationSettings(), {}, "")
    assert [path.stat().st_ino for path in folder.glob("*/*/*.parquet")] == inodes


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
"""A file's name holds a byte that is not text."""


@pytest.fixture
def results(tmp_path):
    """The folder of a fleet with a drive whose results are there."""
    summary = tmp_path / "results" / "a" / "summary.json"
    summary.parent.mkdir(parents=True)
    summary.touch()
    MADE.write(tmp_path)
    return tmp_path / "results"


@pytest.mark.parametrize(
    ("was", "now"), [('"asked"', '"other"'), ("[1, 2]", "[]"), ('"drive": "a"', '"drive": "b"')]
)
def test_what_is_read_is_what_was_written_and_what_was_changed_is_none(results, was, now):
    assert replace(read_made(results.parent, "a"), results="") == MADE
    path = results / "a.json"
    text = path.read_text()
    assert text.count(was) >= 1
    path.write_text(text.replace(was, now))
    assert read_made(results.parent, "a") is None


def test_a_drive_whose_summary_is_another_or_has_gone_is_none_but_for_one_that_failed(results):
    (results / "a" / "summary.json").write_text("{}")
    assert read_made(results.parent, "a") is None
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
