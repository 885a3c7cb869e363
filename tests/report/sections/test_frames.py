"""The frames to look at: what is said about each, and how to open it."""

import cv2
import numpy as np
import pytest

from roadeval.data import ERRORS
from roadeval.report.blocks import Command, ImageGrid, KeepTogether, Text, TwoColumns
from roadeval.report.findings import NotableFrame
from roadeval.report.images import LayerImage
from roadeval.report.sections.frames import NO_COMMAND, strip, worst_frames
from tests.report.making import plain_rows, rates, some_findings, the


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


def test_what_the_filter_did_is_said_once():
    parts = {"svm": 0.1, "filter": 0.2, "post": 0.1}
    notes = ("The filter raised ERR by 21.0 pp on this frame.", "filtered finds nothing.")
    (blocks,) = shown(some_findings(worst=[a_frame(7, parts=parts, notes=notes)]))
    _, _, steps, *rest = said(blocks)
    assert "the filter adds 20.0 pp" in steps
    assert rest == ["filtered finds nothing."]
    (blocks,) = shown(some_findings(worst=[a_frame(7, parts={"post": 0.4}, notes=notes)]))
    assert said(blocks)[2:] == [" ".join(notes)]


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


# --- A frame on a page ----------------------------------------------------------------------------

IMAGE, MASK = np.zeros((4, 6, 3), np.uint8), np.zeros((4, 6), np.uint8)


def test_a_strip_has_the_outcomes_first_and_then_a_row_of_layers_a_variant():
    frame = NotableFrame(
        7,
        12_345_000_000,
        "filtered",
        {"filtered": rates(0.4, 0.3, 0.2)},
        notes=["A note."],
        images=[LayerImage("camera", IMAGE), LayerImage("filtered: errors", IMAGE, ERRORS, MASK)],
        layers=[
            [LayerImage(title, IMAGE, ERRORS, MASK) for title in ("filtered: ndi", "svm")],
            [],
        ],
    )
    found = strip(frame, ["filtered"], "open it")
    assert [*found.sentences] == ["Stamp 12.345 s", "A note."]
    assert plain_rows(found.rates) == [["filtered", "40.00", "30.00", "20.00"]]
    assert [[each.name for each in row] for row in found.rows] == [
        ["camera", "filtered: errors"],
        ["filtered: ndi", "filtered: svm"],
        [],
    ]


def test_outcomes_are_at_most_640_pixels_across_and_layers_300():
    image, mask = np.zeros((4, 700, 3), np.uint8), np.zeros((4, 700), np.uint8)
    outcome, layer = (LayerImage(title, image, ERRORS, mask) for title in ("errors", "svm"))
    frame = NotableFrame(
        7, 0, "filtered", {"filtered": rates(0.4)}, images=[outcome], layers=[[layer]]
    )
    found = strip(frame, ["filtered"])
    assert [[across(each) for each in row] for row in found.rows] == [[640], [300]]


def across(picture):
    """Pixels across a picture's file."""
    content = np.frombuffer(picture.image.content, np.uint8)
    return cv2.imdecode(content, cv2.IMREAD_COLOR).shape[1]
