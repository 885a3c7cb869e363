"""Tables read back: what each column is, whatever stands in it."""

import hashlib
import math

import pytest

from roadeval.results.rows import Key, csv_lines
from roadeval.results.schema import TABLES
from roadeval.results.tables import ResultsError, TableFacts, read_table

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
