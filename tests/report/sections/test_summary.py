"""The first page: which numbers stand out, and what a reader is warned of."""

import math

import pytest

from roadeval.data.words import DASH
from roadeval.report.blocks import BulletList, LinkList, Table, Text
from roadeval.report.findings import NotableFrame
from roadeval.report.sections.summary import section, warnings
from roadeval.report.tables import rates_table
from roadeval.results.facts import FrameAccount, TrainingFacts
from tests.report.making import a_total, column, plain_rows, some_findings


def bold(table, title):
    return [cell.text for cell in column(table, title) if cell.bold]


@pytest.mark.parametrize(
    ("title", "best"),
    [
        ("ERR", "10.00"),
        ("FPR", "11.00"),
        ("FNR", "12.00"),
        ("ACC", "90.00"),
        ("pooled ERR", "11.00"),
        ("IoU", "75.00"),
    ],
)
def test_the_best_of_each_column_is_bold_the_lowest_error_and_the_highest_accuracy(title, best):
    assert bold(rates_table(some_findings().facts), title) == [best]


def test_boundaries_are_best_where_they_are_highest_and_may_be_unknown():
    each = {"width": 5, "flicker": None}
    known = {
        "filtered": each | {"boundary_F": 0.4, "boundary_IoU": 0.3},
        "unfiltered": each | {"boundary_F": 0.8, "boundary_IoU": 0.2},
    }
    table = rates_table(some_findings(beyond=known).facts)
    assert bold(table, "boundary F") == ["80.00"]
    assert bold(table, "boundary IoU") == ["30.00"]
    assert plain_rows(table)[2][-2:] == [DASH, DASH]
    assert "within 5 pixels" in table.caption


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


def test_every_final_mask_has_its_row():
    rows = plain_rows(rates_table(some_findings().facts))
    assert rows[1] == [
        *("unfiltered", "15.00", "16.00", "17.00", "85.00", "16.00"),
        *("75.00", "62.50", "85.71", "80.00"),
    ]


def test_the_frames_are_a_column_only_where_they_differ():
    findings = some_findings()
    assert "means over 1,200 frames" in rates_table(findings.facts).caption
    findings.totals["filtered"]["post"]["frames"] = 7
    table = rates_table(findings.facts)
    assert column(table, "frames") == ["7", "1,200", "1,200"]
    assert "means over the evaluated frames" in table.caption


def test_who_is_worse_than_the_baseline_is_named():
    (warning,) = warnings(some_findings())
    assert warning.startswith("unfiltered is worse than blind (ERR 12.00 %)")


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


def test_the_page_has_the_verdict_how_sure_it_is_and_every_count():
    account = FrameAccount(1210, 1210, evaluated=1200, skipped={"trained on": 10})
    findings = some_findings(verdict="It helps. It probably does.", frames=account)
    blocks = list(section(findings))
    texts = [block.text for block in blocks if isinstance(block, Text)]
    assert texts == [
        "It helps. It probably does.",
        "Probably: by chance alone, one drive in ten would show as much.",
        "1,200 of 1,210 frames were evaluated. Left out: 10 to train on.",
    ]


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
