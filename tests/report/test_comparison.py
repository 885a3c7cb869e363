"""A comparison for people: Markdown for a pull request, and a document."""

from dataclasses import replace

from roadeval.evaluation.comparison import (
    Condition,
    MovedFrame,
)
from roadeval.report.blocks import Table
from roadeval.report.chart import Chart, ChartKind, Series, looks
from roadeval.report.comparison import document
from tests.evaluation import making
from tests.evaluation.making import a_change, a_difference
from tests.report.making import plain_rows

CHANGE = a_change(a_difference(1.2, 0.5, 2), result="new|er")
LIMITS = tuple(
    Condition.parse(text).judge(CHANGE)
    for text in ("post.filtered.ERR > 1pp", "post.filtered.FPR > 50%")
)


def a_comparison(change=CHANGE, **more):
    known = {
        "changes": (change,),
        "moved": (MovedFrame("new|er", "filtered", 7, 0, 0.1, 0.4, 0.3),),
        "warnings": ("the <gap> is left out",),
    }
    return making.a_comparison(CHANGE, **known | more)


def blocks(kind, comparison):
    """The blocks of a kind in a comparison's document."""
    return [b for b in document(comparison, LIMITS, over_drive()).blocks if isinstance(b, kind)]


def over_drive():
    drawn = looks(["base: filtered", "new|er: filtered"])
    series = [Series(name, look, [4.5], [10.0]) for name, look in drawn.items()]
    return [Chart("ERR", ChartKind.LINES, series)]


def test_a_variant_of_which_no_stage_changed_has_no_rows():
    svm = a_change(a_difference(0, 0, 0), "wide", result="new|er")
    rows = CHANGE, replace(svm, stage="svm", final=False), svm
    table, *_ = blocks(Table, a_comparison(changes=rows))
    assert {row[0] for row in plain_rows(table)} == {"filtered", ""}
    post = replace(CHANGE, variant="wide")
    table, *_ = blocks(Table, a_comparison(changes=(*rows[:2], post)))
    assert [row[:2] for row in plain_rows(table)][3:5] == [["wide", "svm"], ["", "post"]]
