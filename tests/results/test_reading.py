"""Tables read back: what each column is, whatever stands in it."""

import math

import pytest

from roadeval.evaluation import metrics
from roadeval.results.reading import RATES, TableError, read_table

COLUMNS = ("frame", "variant", "TP", "ERR", "pooled_FPR")
HEADER = ",".join(COLUMNS) + "\n"
KINDS = {"frame": "int64", "TP": "int64", "ERR": "float64", "pooled_FPR": "float64"}


def kinds(table):
    return {name: str(table[name].dtype) for name in KINDS}


def test_numbers_come_back_bit_by_bit():
    rates = [0.1 + 0.2, 1 / 3, 5e-324, 0.7142857142857143]
    lines = "".join(f"{n},net,{2**62 + n},{rate},0.0\n" for n, rate in enumerate(rates))
    table = read_table(HEADER + lines, COLUMNS)
    assert table["ERR"].tolist() == rates
    assert table["TP"].tolist() == [2**62 + n for n in range(4)]


@pytest.mark.parametrize("name", ["007", "NA", "nan", "null", "true"])
def test_a_name_is_text_whatever_it_looks_like(name):
    assert read_table(f"{HEADER}1,{name},2,0.5,0.5\n", COLUMNS)["variant"].tolist() == [name]


def test_a_rate_that_is_undefined_everywhere_is_a_number_all_the_same():
    table = read_table(f"{HEADER}1,net,2,,1\n", COLUMNS)
    assert math.isnan(table["ERR"][0])
    assert kinds(table) == KINDS


@pytest.mark.parametrize("text", ["", HEADER])
def test_a_table_without_rows_has_its_columns(text):
    table = read_table(text, COLUMNS)
    assert table.empty
    assert tuple(table.columns) == COLUMNS
    assert kinds(table) == KINDS


def test_a_file_is_read_like_its_text(tmp_path):
    text = f"{HEADER}1,net,2,0.1,0.25\n"
    (tmp_path / "frames.csv").write_text(text)
    assert read_table(tmp_path / "frames.csv", COLUMNS).equals(read_table(text, COLUMNS))


def test_the_rates_are_those_of_the_evaluation():
    assert tuple(metrics.METRICS) == RATES


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "Empty CSV file"),
        (HEADER[:-10], "Empty CSV file"),
        (f"{HEADER}1,net,2,0.1,0.25\n2,net", "Expected 5 columns, got 2"),
        (f"{HEADER}1,net,2,0.1,0.2", "its last line is cut off"),
        (f"{HEADER}1,net,two,0.1,0.25\n", "two"),
        ("frame,variant\n1,net\n", "no column ERR, TP, pooled_FPR"),
    ],
)
def test_a_damaged_file_is_named_in_one_line(text, why, tmp_path):
    (tmp_path / "frames.csv").write_text(text)
    with pytest.raises(TableError, match=why) as caught:
        read_table(tmp_path / "frames.csv", COLUMNS)
    assert str(caught.value).startswith(f"{tmp_path / 'frames.csv'}: damaged (")
    assert "\n" not in str(caught.value)
