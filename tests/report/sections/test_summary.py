"""The first page: which numbers stand out, and what a reader is warned of."""

import math

from roadeval.data.words import DASH
from roadeval.report.blocks import BulletList, LinkList, Table
from roadeval.report.findings import NotableFrame
from roadeval.report.sections.summary import section, warnings
from roadeval.report.tables import rates_table
from roadeval.results.facts import TrainingFacts
from tests.report.making import a_total, column, plain_rows, some_findings


def bold(table, title):
    return [cell.text for cell in column(table, title) if cell.bold]


def test_an_undefined_rate_is_never_the_best():
    findings = some_findings()
    findings.totals["filtered"]["post"]["ERR"] = math.nan
    assert bold(rates_table(findings.facts), "ERR") == ["12.00"]


ALONE = {"filtered": {"post": a_total(0.1)}}
SEEDS = {
    "seeds": [0, 1, 2],
    "totals": {
        name: {"post": {rate: [0.1, 0.3, 0.15] for rate in ("ERR", "FPR", "FNR", "ACC")}}
        for name in ("filtered", "unfiltered")
    },
    "difference": {"post": {"ERR": [0.01, 0.02, 0.03]}},
}


def test_the_spread_over_seeds_stands_below_the_rates():
    findings = some_findings()
    assert len([block for block in section(findings) if isinstance(block, Table)]) == 1
    blocks = list(section(some_findings(seeds=SEEDS)))
    _, table = (block for block in blocks if isinstance(block, Table))
    assert plain_rows(table) == [
        ["filtered", *["15.00 (10.00 to 30.00)"] * 4],
        ["unfiltered", *["15.00 (10.00 to 30.00)"] * 4],
        ["filtered \N{MINUS SIGN} unfiltered, pp", "+2.00 (+1.00 to +3.00)", *[DASH] * 3],
    ]


def test_the_frames_are_a_column_only_where_they_differ():
    findings = some_findings()
    assert "means over 1,200 frames" in rates_table(findings.facts).caption
    findings.totals["filtered"]["post"]["frames"] = 7
    table = rates_table(findings.facts)
    assert column(table, "frames") == ["7", "1,200", "1,200"]
    assert "means over the evaluated frames" in table.caption


def test_undefined_rates_are_told_and_how_often():
    undefined = {"FNR": 1200, "FPR": 3, "ERR": 0}
    totals = {"filtered": {"post": a_total(0.1) | {"undefined": undefined}}}
    assert list(warnings(some_findings(totals=totals))) == [
        "filtered: undefined on every frame: FNR.",
        "filtered: undefined on some of 1200 frames, and left out: FPR on 3.",
    ]


def test_three_losses_are_named_and_the_others_counted():
    findings = some_findings(totals=ALONE, losses=["a", "b", "c", "d", "e"])
    assert list(warnings(findings)) == [
        *("Lost: a", "Lost: b", "Lost: c"),
        "2 more frames were lost; summary.json names them.",
    ]


def test_a_drive_that_trained_itself_says_so():
    own = some_findings(totals=ALONE, training=TrainingFacts("truth"))
    assert [text.partition(" (")[0] for text in warnings(own)] == [
        "Trained on this drive's own first frames"
    ]
    given = TrainingFacts("truth", model="city.model")
    assert not list(warnings(some_findings(totals=ALONE, training=given)))


def test_below_the_verdict_are_the_worst_frame_and_the_command_that_opens_it():
    rates = {"filtered": {"ERR": 0.312}}
    frame = NotableFrame(80, 0, "filtered", rates)
    found = some_findings(worst=[frame])
    blocks = list(section(found))
    links = [("Worst frame: 80, where filtered gets 31.2 % wrong", "#frame-80")]
    assert blocks[2] == LinkList(links, "open frame 80")
    unseen = some_findings(worst=[frame], inspect=None)
    gone = [each for each in section(unseen) if isinstance(each, LinkList)]
    assert gone == [LinkList(links)]


def test_a_partial_recording_is_marked_before_the_verdict():
    blocks = list(section(some_findings(complete=False)))
    assert isinstance(blocks[1], BulletList)
    assert blocks[1].tone == "warning"
    assert "did not reach its end" in blocks[1].items[0]


# --- Settings and versions: what all variants share is told once ----------------------------------
