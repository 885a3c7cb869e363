"""Tables read back, what each column is; and rows that are made of sums."""

import hashlib
import math
import tracemalloc

import numpy as np
import pytest

from roadeval.data import Counts
from roadeval.data.arrays import FN, FP, IGNORED
from roadeval.evaluation import metrics
from roadeval.evaluation.score.scoreboard import Scoreboard
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.tables import concatenate, windows
from roadeval.results.rows import Key, csv_lines, sum_rows, table_of_scores
from roadeval.results.schema import OF_A_DRIVE, OF_DRIVES, TABLES, Kind
from roadeval.results.tables import ResultsError, TableFacts, read_table
from tests.evaluation.making import a_table, table_of
from tests.results.making import KEY

HEADER = TABLES["oracles"].header
KINDS = {"frame": "int64", "TP": "int64", "ERR": "float64", "FPR": "float64"}


def line(frame=1, variant="net", tp=2, err="0.5"):
    return f"drive,/camera,{frame},{variant},svm,post,{tp},4,0,0,6,0.5,{err},0.1,0.2,0.3,0.25\n"


def kinds(table):
    return {name: str(table[name].dtype) for name in KINDS}


def test_numbers_come_back_bit_exactly():
    rates = [0.1 + 0.2, 1 / 3, 5e-324, 0.7142857142857143]
    lines = "".join(line(n, "net", 2**62 + n, rate) for n, rate in enumerate(rates))
    table = read_table("oracles", HEADER + lines)
    assert table["ERR"].tolist() == rates
    assert table["TP"].tolist() == [2**62 + n for n in range(4)]


@pytest.mark.parametrize("name", ["007", "NA", "nan", "null", "true"])
def test_a_name_is_text_whatever_it_looks_like(name):
    assert read_table("oracles", HEADER + line(variant=name))["variant"].tolist() == [name]


@pytest.mark.parametrize("text", ["", HEADER])
def test_a_table_without_rows_has_its_columns(text):
    table = read_table("oracles", text)
    assert table.empty
    assert tuple(table.columns) == TABLES["oracles"].names
    assert kinds(table) == KINDS


@pytest.mark.parametrize("err", [math.nan, 0.5])
def test_a_row_reads_back_as_it_was_counted(err):
    row = (1, "net", "svm", "post", 2, 4, 0, 0, 6, 0.5, err, 0.1, 0.2, 0.3, 0.25)
    text = csv_lines(Key("drive", "/camera"), {"oracles": [row]})["oracles"]
    assert text == line(err="" if math.isnan(err) else str(err))
    (read,) = read_table("oracles", HEADER + text).itertuples(index=False, name=None)
    assert read == pytest.approx(("drive", "/camera", *row), nan_ok=True)


def test_of_several_cameras_one_can_be_read():
    text = HEADER + line(1) + line(2).replace("/camera", "/rear")
    assert read_table("oracles", text, camera="/rear")["frame"].tolist() == [2]
    assert len(read_table("oracles", text)) == 2


def test_of_some_masks_alone_the_rows_are_the_same():
    variants = ("net", "plain", "blind", "other")
    lines = [line(frame, variants[frame % 4], frame) for frame in range(20_000)]  # 2 blocks
    text = HEADER + "".join(lines).replace("svm,post,7,", "svm,similarity,7,")
    whole = read_table("oracles", text)
    masks = [("net", "post"), ("blind", "post"), ("other", "similarity"), ("gone", "post")]
    rows = read_table("oracles", text, masks=masks)
    expected = whole[(whole["stage"] == "post") & whole["variant"].isin(["net", "blind"])]
    assert rows["frame"].tolist() == sorted([*expected["frame"], 7])
    assert kinds(rows) == KINDS
    assert read_table("oracles", text, masks=[]).empty
    with pytest.raises(ResultsError, match="lacks a value"):
        read_table("oracles", text + line(9, "net").replace(",2,", ",,"), masks=masks)


def test_a_drive_s_and_a_camera_s_name_may_hold_anything(tmp_path):
    key = Key('a, "b"\n', "/front/image")
    rows = {"disagreements": [(1, "filtered", "unfiltered", 2, 3, 9)]}
    text = csv_lines(key, rows)["disagreements"]
    assert text.count("\n") == 1
    (row,) = read_table("disagreements", TABLES["disagreements"].header + text).to_dict("records")
    assert (row["drive"], row["camera"]) == ('a, "b"\\n', "/front/image")


def test_a_table_of_any_size_is_read_with_the_names_that_come_late():
    """More than what is parsed at once."""
    lines = [line(n, "net" if n % 3 else "other", n, "0.5" if n % 2 else "") for n in range(40_000)]
    table = read_table("oracles", "".join([HEADER, *lines, line(40_000, "late", 1, "")]))
    assert table["frame"].tolist() == [*range(40_001)]
    assert table["variant"].tolist()[-2:] == ["other" if 39_999 % 3 == 0 else "net", "late"]
    assert (table["ERR"].isna() == (table["frame"] % 2 == 0)).all()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (HEADER[:-10], "Empty CSV file"),
        (f"{HEADER}{line()}2,net", "Expected 17 columns, got 2"),
        (f"{HEADER}{line()}"[:-2], "its last line is cut off"),
        (f"{HEADER}{line(tp='two')}", "two"),
        (f"{HEADER}{line(tp='')}", "column TP lacks a value"),
        (f"{HEADER}{line(tp=-1)}", "column TP holds -1"),
        (f"{HEADER}{line(err='inf')}", "column ERR holds inf"),
        (f"{HEADER}{line(err='-0.5')}", "column ERR holds -0.5"),
        ("drive,camera,frame,variant\na,b,1,net\n", "no column oracle, stage, TP"),
        ("frame,frame\n1,1\n", "a column is there twice"),
        (HEADER + line(1) + line(2) + line(1), "a row is there twice"),
    ],
)
def test_a_damaged_file_is_named_in_one_line(text, why, tmp_path):
    (tmp_path / "oracles.csv").write_text(text)
    with pytest.raises(ResultsError, match=why) as caught:
        read_table("oracles", tmp_path / "oracles.csv")
    assert str(caught.value).startswith(f"{tmp_path / 'oracles.csv'}: damaged (")
    assert "\n" not in str(caught.value)


def test_text_that_is_not_the_summarys_is_refused_and_named():
    text = HEADER + line(1) + line(2)
    summary = {"oracles": TableFacts(2, hashlib.sha256(text.encode()).hexdigest())}
    assert len(read_table("oracles", text, summary)) == 2
    with pytest.raises(ResultsError, match=r"^the recording's table oracles: .* \(1 of 2 rows\)"):
        read_table("oracles", HEADER + line(1), summary)


@pytest.mark.parametrize("name", ["=cmd()", "../../x", "a b", "$x$", "\x1b[2J", "größe", "n,et"])
def test_a_name_that_no_result_can_hold_is_damage(name):
    with pytest.raises(ResultsError, match="damaged"):
        read_table("oracles", HEADER + line() + line(variant=name))


NOTHING = table_of("frames", [])


def test_a_level_with_as_many_pixels_of_road_as_of_the_rest_has_a_row():
    counts = np.zeros((2, 1 << 16), np.int64)
    counts[:, 300] = 4
    board = Scoreboard(KEY, EvaluationSettings(), ["net"], None)
    board.curves.add({("net", "post"): counts})
    rows = sum_rows(board, windows(NOTHING, 10))
    assert rows.pop("probabilities") == [("net", "post", 1, 4, 4)]
    assert not any(rows.values())


def heat_rows(*cells):
    """The rows of ``heat`` of one frame, of which each number is the error of a whole cell."""
    board = Scoreboard(KEY, EvaluationSettings(), ["net"], None)
    board.heat["net"].add(np.kron(np.array(cells, np.uint8), np.ones((8, 8), np.uint8)))
    return sum_rows(board, windows(NOTHING, 10))["heat"]


def test_cells_with_errors_or_without_a_label_have_a_row_and_so_has_the_last_one():
    assert heat_rows([0, FP, 1], [IGNORED, FN, 0]) == [
        ("net", 0, 8, 8, 64, 64, 0),
        ("net", 8, 0, 8, 0, 0, 0),
        ("net", 8, 8, 8, 64, 0, 64),
        ("net", 8, 16, 8, 64, 0, 0),
    ]


def test_a_heat_map_without_any_label_has_no_row():
    assert heat_rows([IGNORED, IGNORED]) == []


# --- Scores of any number of drives ---------------------------------------------------------------


def of_region(frame, n, region="lit", **key):
    """A row of ``regions`` with ``n`` of 10 pixels wrong; of 0 pixels for -1."""
    counts = {"TP": 5, "TN": 5 - n, "FP": n, "FN": 0, "N": 10}
    counts = counts if n >= 0 else dict.fromkeys(counts, 0)
    return {"frame": frame, "variant": "net", "stage": "post", "region": region, **counts, **key}


def test_each_mask_has_a_row_of_its_own_on_all_pixels_and_one_of_each_region():
    masks = {("net", "svm"): [20, 40], ("net", "post"): [10, 30]}
    frames = concatenate([a_table(masks), a_table({("net", "svm"): [50]}, drive="road")])
    regions = table_of("regions", [of_region(0, 2), of_region(1, -1), of_region(0, 1, "far")])
    known = {"variant": "net", "boundary_f": 0.7, "drive": "street", "camera": KEY.camera}
    rows = table_of_scores(frames, regions, [known])
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
    assert rows["truth"].tolist() == [14, 14, 0, 0, 7]
    pooled = metrics.of(Counts(tp=100, tn=60, fp=40))
    assert rows["pooled_FPR"].iloc[1] == pooled["FPR"]


def test_the_truth_of_a_drive_has_a_checksum_whatever_the_order_of_its_frames():
    frames = a_table({("net", "post"): [20, 40, 10]}).assign(truth=[2**63 - 1, 2**32 - 1, 7])
    there, back = (
        table_of_scores(rows, table_of("regions", [of_region(0, 2)]), [])
        for rows in (frames, frames[::-1])
    )
    wrapped = 2**63 + 2**32 + 5 - 2**64
    assert there["truth"].tolist() == back["truth"].tolist() == [wrapped, 0]
    assert there["truth"].dtype == np.int64


def test_nothing_scored_has_no_scores():
    rows = table_of_scores(NOTHING, table_of("regions", []), [])
    assert rows.empty
    assert [*rows] == [*TABLES["scores"].names]


# --- One schema a table: what is written, read and documented is the same -------------------------


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_every_column_has_a_name_of_its_own_and_a_line_of_documentation(table):
    assert len(set(table.names)) == len(table.names)
    assert all(column.doc for column in table.columns)


def test_every_table_begins_with_its_drive_and_camera_and_is_of_one_drive_or_of_many():
    assert {*OF_A_DRIVE, *OF_DRIVES} == {*TABLES}
    assert all(
        [n for n in table.names if n != "rank"][:2] == ["drive", "camera"]
        for table in TABLES.values()
    )


def test_a_long_table_is_read_in_pieces_and_can_be_written_to_like_a_short_one(tmp_path):
    header = TABLES["changes"].header
    cells = ["1" if column.kind is Kind.COUNT else 40 * "n" for column in TABLES["changes"].columns]
    for count in (1, 50_000):
        path, content = tmp_path / "changes.csv", f"{header}{(','.join(cells) + chr(10)) * count}"
        path.write_text(content)
        facts = TableFacts(count, hashlib.sha256(content.encode()).hexdigest())
        tracemalloc.start()
        try:
            table = read_table("changes", path, {"changes": facts})
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        assert len(table) == count
        assert count == 1 or peak < len(content)
        table.loc[0, "N"] = 5
        assert table["N"].iloc[0] == 5
