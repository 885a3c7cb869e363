"""A comparison for people: Markdown for a pull request, and a document."""

from dataclasses import replace

import numpy as np

from roadeval.evaluation.comparison import (
    Condition,
    MovedFrame,
    Side,
    compare,
    judge,
)
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.report.blocks import BulletList, Figure, Heading, Table
from roadeval.report.chart import Chart, ChartKind, Series, looks
from roadeval.report.comparison import document, markdown
from roadeval.report.pdf.typeset import pdf
from roadeval.results.comparison import judged
from tests.evaluation import making
from tests.evaluation.making import a_change, a_difference, a_part
from tests.report.making import links_within, plain_rows, text

CHANGE = a_change(a_difference(1.2, 0.5, 2), result="new|er")
LIMITS = tuple(
    Condition.parse(text).judge(CHANGE)
    for text in ("post.filtered.ERR > 1pp", "post.filtered.FPR > 50%")
)
FAILED, KEPT = map(judged, LIMITS)
PRESETS = {"preset": ("paper", "gated")}


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


def test_markdown_has_exceeded_limits_first_and_names_do_not_break_its_tables():
    lines = markdown(a_comparison(), LIMITS).splitlines()
    exceeded = lines.index("**Limits exceeded**")
    assert lines[exceeded + 2] == f"- {FAILED}".replace("|", "\\|").replace(">", "\\>")
    assert "new\\|er against base" in lines[exceeded:]
    assert "| filtered | post | ERR | 10.00 | 11.20 | +1.20 | +0.50 to +2.00 |" in lines
    assert "| filtered | 7 | 0.000 s | 10.00 | 40.00 | +30.00 |" in lines
    assert "| --- | ---: | --- | ---: | ---: | ---: |" in lines
    assert "- the \\<gap\\> is left out" in lines


def test_a_variant_of_which_no_stage_changed_has_no_rows():
    svm = a_change(a_difference(0, 0, 0), "wide", result="new|er")
    rows = CHANGE, replace(svm, stage="svm", final=False), svm
    table, *_ = blocks(Table, a_comparison(changes=rows))
    assert {row[0] for row in plain_rows(table)} == {"filtered", ""}
    post = replace(CHANGE, variant="wide")
    table, *_ = blocks(Table, a_comparison(changes=(*rows[:2], post)))
    assert [row[:2] for row in plain_rows(table)][3:5] == [["wide", "svm"], ["", "post"]]


def test_its_contents_lead_to_its_parts():
    made = document(a_comparison(), LIMITS, [])
    assert links_within(pdf(made)) == 2


# --- Several drives -------------------------------------------------------------------------------


def of_drives():
    """A comparison of 30 drives with two variants, one of them worse on every third."""
    rng = np.random.default_rng(3)

    def a_result(label, change):
        parts = []
        for place in range(30):
            own = {
                (variant, "post"): (15 + rng.integers(-3, 4, 20) + more).tolist()
                for variant, more in (
                    ("filtered", 0 if place % 3 else change),
                    ("unfiltered", 0),
                )
            }
            about = {"drive": f"drive_{place}", "digest": f"d{place}"}
            parts.append(a_part(own, **about))
        return Side(label, parts)

    found = compare([a_result("base", 0), a_result("new", 9)], EvaluationSettings())
    limits = ["post.filtered.ERR > +0.5pp", "post.filtered.ERR > 50%"]
    return found, judge(found, [*map(Condition.parse, limits)], found.settings)


COMPARED, JUDGED = of_drives()


def made_of(kind):
    return [b for b in document(COMPARED, JUDGED, []).blocks if isinstance(b, kind)]


def test_drives_that_changed_are_listed_the_surest_first():
    table = made_of(Table)[1]
    rows = plain_rows(table)
    assert {row[1] for row in rows} == {f"drive_{place}" for place in range(0, 30, 3)}
    q = [float(row[-1]) for row in rows]
    assert q == sorted(q)
    assert max(q) <= 0.05


def test_the_document_of_several_drives_has_the_plots():
    assert [b.title for b in made_of(BulletList)] == ["Limits exceeded", "Limits kept", "Where"]
    assert len(made_of(Figure)) == 2
    headings = [b.text for b in made_of(Heading)]
    assert "Which drives changed" in headings
    words = text(pdf(document(COMPARED, JUDGED, [])))
    assert "filtered: over 30 drives new instead of base raises ERR of post" in words
    assert "Holm's correction for the 2 differences of ERR" in words
