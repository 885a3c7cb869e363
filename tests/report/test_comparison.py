"""A comparison for people: Markdown for a pull request, and a document."""

from dataclasses import replace

import pandas as pd

from roadeval.data.words import MINUS
from roadeval.evaluation.comparison_result import (
    ComparedResult,
    Comparison,
    Disagreement,
    LogUnknown,
    MaskComparison,
    MovedFrame,
)
from roadeval.evaluation.conditions import Condition
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.uncertainty import Difference
from roadeval.report.blocks import BulletList, Cell, Table, Text
from roadeval.report.comparison import document, markdown
from roadeval.report.pdf.typeset import pdf
from roadeval.results.comparison import judged
from tests.evaluation.making import rows_of
from tests.report.making import NO_WINDOWS, links_within, text


def change_of(mean, low=None, high=None):
    return Difference(mean, low, high, 0.95, None if low is None else 0.01, 12, None)


RATES = {"ERR": 0.10, "FPR": 0.20, "FNR": 0.30, "IoU": 0.8}
CHANGE = MaskComparison(
    result="new|er",
    variant="filtered",
    stage="post",
    final=True,
    frames=12,
    base=RATES,
    new=RATES | {"ERR": 0.112, "FPR": 0.21, "FNR": 0.28},
    difference=dict.fromkeys(("ERR", "FPR", "FNR"), change_of(0.012, 0.005, 0.02)),
)
LIMITS = tuple(
    Condition.parse(text).judge(CHANGE)
    for text in ("post.filtered.ERR > 1pp", "post.filtered.FPR > 50%")
)
FAILED, KEPT = map(judged, LIMITS)


def a_comparison(change=CHANGE, **changes):
    plain = {
        "same_drive": True,
        "results": tuple(
            ComparedResult(label, "street", "d", 12, None) for label in ("base", "new|er")
        ),
        "changes": (change,),
        "levels": (),
        "moved": (MovedFrame("new|er", "filtered", 7, 0, 0.1, 0.4, 0.3),),
        "notes": (LogUnknown("the <gap>"),),
        "settings": EvaluationSettings(),
    }
    return Comparison(**plain | changes)


def blocks(kind, comparison):
    """The blocks of a kind in a comparison's document."""
    return [b for b in document(comparison, LIMITS, windows()).blocks if isinstance(b, kind)]


def windows():
    rates = {"ERR": 0.1, "FPR": 0.1, "FNR": 0.1}
    place = {"window": 0, "first_frame": 0, "last_frame": 9, "frames": 10, "stage": "post"}
    return rows_of(
        pd.DataFrame([{**place, "variant": name, **rates} for name in ("base", "new|er")])
    )


def test_markdown_tells_failures_first_and_keeps_names_from_breaking_the_table():
    lines = markdown(a_comparison(), LIMITS).splitlines()
    assert f"- **FAIL**: {FAILED}".replace("|", "\\|").replace(">", "\\>") in lines
    assert (
        "| new\\|er | filtered | post | 10.00 | 11.20 | +1.20 | +0.50 to +2.00 | +1.00 "
        f"| {MINUS}2.00 |"
    ) in lines
    assert "| new\\|er | filtered | 7 | 0.000 s | 10.00 | 40.00 | +30.00 |" in lines
    assert "| --- | --- | ---: | --- | ---: | ---: | ---: |" in lines
    assert "- the \\<gap\\> does not say which log it is of: nothing is subtracted" in lines


def test_the_document_has_the_numbers_and_the_frames():
    words = text(pdf(document(a_comparison(), LIMITS, windows())))
    for wanted in ("Limits exceeded", FAILED, "+1.20", "the <gap>", "new|er"):
        assert wanted in words


def test_limits_that_are_exceeded_and_kept_are_told_apart():
    lists = blocks(BulletList, a_comparison())
    assert [(each.title, list(each.items)) for each in lists[:2]] == [
        ("Limits exceeded", [FAILED]),
        ("Limits kept", [KEPT]),
    ]


def test_a_rule_stands_where_another_result_begins_and_its_name_only_where_it_is_needed():
    rows = CHANGE, replace(CHANGE, stage="svm"), replace(CHANGE, result="newest")
    table, _ = blocks(Table, a_comparison(changes=rows))
    assert table.breaks == [2]
    assert table.columns[:3] == ["result", "variant", "stage"]
    table, _ = blocks(Table, a_comparison(replace(CHANGE, result="filtered")))
    assert table.columns[:2] == ["variant", "stage"]


def test_a_missing_interval_is_explained_by_the_result_and_its_variant():
    few = replace(CHANGE, difference=dict.fromkeys(("ERR", "FPR", "FNR"), change_of(0.012)))
    why = "no interval for ERR, because 12 frames are too few for an interval."
    for variant, name in (("filtered", "new|er, filtered"), ("new|er", "new|er")):
        notes = blocks(Text, a_comparison(replace(few, variant=variant)))
        assert f"{name}: {why}" in [note.text for note in notes]


def test_different_drives_are_laid_side_by_side():
    change = replace(CHANGE, base={}, difference={})
    comparison = a_comparison(change, same_drive=False, moved=())
    (table,) = blocks(Table, comparison)
    assert dict(zip(table.columns, *table.rows, strict=True)) == {
        "result": "new|er",
        "variant": "filtered",
        "stage": "post",
        "frames": "12",
        "ERR": "11.20",
        "FPR": "21.00",
        "FNR": "28.00",
        "IoU": "80.00",
    }
    assert table.text_columns == range(3)
    words = text(pdf(document(comparison, (), NO_WINDOWS)))
    assert "Different drives, side by side: no difference is given." in words
    assert "11.20" in words


def test_of_a_frame_of_disagreement_the_sum_of_both_shares_is_bold():
    rows = (
        Disagreement("new|er", "filtered", 7, 0, base_right=0.1, new_right=0.25),
        Disagreement("newest", "filtered", 8, 100_000_000, base_right=0.2, new_right=0.0),
    )
    tables = blocks(Table, a_comparison(disagreements=rows))
    (table,) = (table for table in tables if "disagree" in table.columns)
    assert table.columns[4:] == ["disagree", "base right", "new right"]
    assert table.rows == [
        ["new|er", "filtered", "7", "0.000 s", Cell("35.00", bold=True), "10.00", "25.00"],
        ["newest", "filtered", "8", "0.100 s", Cell("20.00", bold=True), "20.00", "0.00"],
    ]
    assert table.text_columns == [0, 1, 3]
    assert table.breaks == [1]


def test_its_contents_lead_to_its_parts():
    made = document(a_comparison(), LIMITS, NO_WINDOWS)
    assert links_within(pdf(made)) == 2
