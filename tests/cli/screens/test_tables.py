"""Tables on a terminal."""

import io

from rich.console import Console

from roadeval.cli.screens.tables import show_table
from roadeval.data.words import DASH, MINUS
from roadeval.report.blocks import Cell, Table

TITLES = ["variant", "stage", "ERR %", "FPR %", "pooled ERR %"]
ROW = ["filtered", "post", "1.00", Cell("2.00", bold=True), "3.00"]


def printed(width, row=ROW):
    out = Console(file=io.StringIO(), width=width)
    show_table(Table(TITLES, [row], text_columns=(0, 1)), out)
    return [line.split() for line in out.file.getvalue().splitlines() if line and "─" not in line]


def test_columns_that_do_not_fit_stand_below_with_the_names_again():
    assert printed(42) == [
        ["variant", "stage", "ERR", "%", "FPR", "%"],
        ["filtered", "post", "1.00", "2.00"],
        ["variant", "stage", "pooled", "ERR", "%"],
        ["filtered", "post", "3.00"],
    ]


def test_numbers_are_ascii_alone():
    out = Console(file=io.StringIO(), width=80)
    rows = [["a", f"{MINUS}2.00 to {MINUS}1.00 *"], ["b", DASH]]
    show_table(Table(["", "interval"], rows), out)
    assert [line.split() for line in out.file.getvalue().splitlines()[2:]] == [
        ["a", "-2.00", "to", "-1.00", "*"],
        ["b", "-"],
    ]
