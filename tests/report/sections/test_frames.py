"""The frames to look at: what is said about each, and how to open it."""

import numpy as np
import pytest

from roadeval.data.words import MINUS
from roadeval.report.blocks import Command, ImageGrid, KeepTogether, Text, TwoColumns
from roadeval.report.findings import NotableFrame
from roadeval.report.images import LayerImage
from roadeval.report.sections.frames import NO_COMMAND, worst_frames
from tests.report.making import column, plain_rows, rates, some_findings, the


def a_frame(number, **changes):
    plain = {
        "rates": {"filtered": rates(0.4, 0.3, 0.2), "unfiltered": rates(0.5, 0.6, 0.7)},
        "parts": {"svm": 0.1, "filter": 0.2, "post": 0.1},
        "notes": ["A note.", "Another."],
    }
    return NotableFrame(number, 12_345_000_000, "filtered", **plain | changes)


def shown(findings):
    return [block.blocks for block in worst_frames(findings) if isinstance(block, KeepTogether)]


def said(blocks):
    return [block.text for block in the(TwoColumns, blocks).left]


def test_a_bad_frame_is_shown_with_its_rates_the_stage_at_fault_and_its_notes():
    (blocks,) = shown(some_findings(worst=[a_frame(7)]))
    assert said(blocks) == [
        "Frame 7",
        "Stamp 12.345 s",
        "filtered: svm without the filter leaves 10.0 % wrong, the filter adds 20.0 pp, post adds "
        "10.0 pp.",
        "A note. Another.",
    ]
    assert plain_rows(the(TwoColumns, blocks).right[0]) == [
        ["filtered", "40.00", "30.00", "20.00"],
        ["unfiltered", "50.00", "60.00", "70.00"],
    ]
    assert [cell.bold for cell in column(the(TwoColumns, blocks).right[0], "ERR")] == [True, False]
    assert the(Command, blocks).text == "open frame 7"


def test_what_the_filter_did_is_said_once():
    parts = {"svm": 0.1, "filter": 0.2, "post": 0.1}
    notes = ("The filter raised ERR by 21.0 pp on this frame.", "filtered finds nothing.")
    (blocks,) = shown(some_findings(worst=[a_frame(7, parts=parts, notes=notes)]))
    _, _, steps, *rest = said(blocks)
    assert "the filter adds 20.0 pp" in steps
    assert rest == ["filtered finds nothing."]
    (blocks,) = shown(some_findings(worst=[a_frame(7, parts={"post": 0.4}, notes=notes)]))
    assert said(blocks)[2:] == [" ".join(notes)]


def test_helped_and_harmed_frames_are_told_apart():
    findings = some_findings(
        worst=[a_frame(1)], helped=[a_frame(2, change=-0.1)], harmed=[a_frame(3, change=0.1)]
    )
    worst, helped, harmed = shown(findings)
    assert worst[0].text == "The worst frames"
    assert helped[0].text == "Frames that the filter helped most"
    assert said(helped)[-1] == f"The filter changes ERR by {MINUS}10.00 pp."
    assert harmed[0].text == "Frames that the filter harmed most"
    assert said(harmed)[-1] == "The filter changes ERR by +10.00 pp."


@pytest.mark.parametrize(("count", "columns"), [(3, 4), (4, 4), (5, 5), (6, 6), (7, 4), (9, 5)])
def test_pictures_of_the_outcomes_fill_their_rows(count, columns):
    image = LayerImage("it", np.zeros((4, 4, 3), np.uint8), None, None)
    (blocks,) = shown(some_findings(worst=[a_frame(7, images=[image] * count)]))
    assert the(ImageGrid, blocks).columns == columns


def test_equal_phases_of_the_variants_stand_below_each_other():
    image = LayerImage("it", np.zeros((4, 4, 3), np.uint8), None, None)
    (blocks,) = shown(some_findings(worst=[a_frame(7, layers=[[image] * 5, [image] * 3])]))
    grids = [block for block in blocks if isinstance(block, ImageGrid)]
    assert [(grid.columns, grid.skip, len(grid.pictures)) for grid in grids] == [
        (5, 0, 5),
        (5, 2, 3),
    ]


def test_where_the_recording_is_not_at_hand_no_command_opens_a_frame_and_that_is_told():
    (blocks,) = shown(some_findings(worst=[a_frame(7)], inspect=None))
    assert not [block for block in blocks if isinstance(block, Command)]
    assert NO_COMMAND in [block.text for block in blocks if isinstance(block, Text)]


def test_where_no_frame_is_the_worst_that_is_told():
    assert the(Text, worst_frames(some_findings())).text == (
        "ERR of filtered is undefined on every frame, so no frame is the worst."
    )
