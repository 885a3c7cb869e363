"""Tables and numbers for the terminal."""

import io
import math

from rich.console import Console

from roadeval.cli.screens import tables
from roadeval.cli.screens.tables import Row

NUMBERS = ("ERR %", "FPR %", "pooled ERR %")
ROWS = [Row(["filtered", "post", "1.00", "2.00", "3.00"])]


def printed(width, numbers=NUMBERS, rows=ROWS):
    out = Console(file=io.StringIO(), width=width)
    tables.show(("variant", "stage"), numbers, rows, out)
    return [line.split() for line in out.file.getvalue().splitlines() if line and "─" not in line]


def test_all_columns_stand_in_one_table_where_there_is_room():
    assert printed(43) == [
        ["variant", "stage", "ERR", "%", "FPR", "%", "pooled", "ERR", "%"],
        ["filtered", "post", "1.00", "2.00", "3.00"],
    ]


def test_columns_that_do_not_fit_stand_below_with_the_names_again():
    assert printed(42) == [
        ["variant", "stage", "ERR", "%", "FPR", "%"],
        ["filtered", "post", "1.00", "2.00"],
        ["variant", "stage", "pooled", "ERR", "%"],
        ["filtered", "post", "3.00"],
    ]


def test_a_long_name_is_folded_rather_than_parting_the_numbers():
    rows = [Row(["a-network-with-a-name-that-is-longer-than-others", *ROWS[0].cells[1:]])]
    assert ["variant", "stage", "ERR", "%", "FPR", "%", "pooled", "ERR", "%"] in printed(
        60, rows=rows
    )


def test_numbers_are_ascii_alone():
    shown = (
        tables.percent(None),
        tables.percent(0.5),
        tables.points(-0.125),
        tables.interval(-0.01, math.nan),
        tables.interval(-0.02, -0.01),
    )
    assert shown == ("-", "50.00", "-12.50", "none given", "-2.00 to -1.00")
