"""The first page: which numbers stand out, and what a reader is warned of."""

import math

from roadeval.report.sections.summary import warnings
from roadeval.report.tables import rates_table
from roadeval.results.facts import TrainingFacts
from tests.report.making import a_total, column, some_findings


def bold(table, title):
    return [cell.text for cell in column(table, title) if cell.bold]


def test_an_undefined_rate_is_never_the_best():
    findings = some_findings()
    findings.totals["filtered"]["post"]["ERR"] = math.nan
    assert bold(rates_table(findings.facts), "ERR") == ["12.00"]


ALONE = {"filtered": {"post": a_total(0.1)}}


def test_undefined_rates_are_told_and_how_often():
    undefined = {"FNR": 1200, "FPR": 3, "ERR": 0}
    totals = {"filtered": {"post": a_total(0.1) | {"undefined": undefined}}}
    assert list(warnings(some_findings(totals=totals))) == [
        "filtered: of 1,200 frames, undefined and left out: FNR on 1,200 and FPR on 3."
    ]


def test_a_drive_that_trained_itself_says_so():
    own = some_findings(totals=ALONE, training=TrainingFacts("truth"))
    assert [text.partition(" (")[0] for text in warnings(own)] == [
        "Trained on frames of this drive"
    ]
    given = TrainingFacts("truth", model="city.model")
    assert not list(warnings(some_findings(totals=ALONE, training=given)))
