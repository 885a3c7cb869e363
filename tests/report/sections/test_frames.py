"""The frames to look at: what is said about each, and how to open it."""

import cv2
import numpy as np

from roadeval.data import ERRORS
from roadeval.report.blocks import Command, KeepTogether, Text, TwoColumns
from roadeval.report.captions import caption
from roadeval.report.findings import NotableFrame
from roadeval.report.images import LayerImage
from roadeval.report.sections.frames import strip, worst_frames
from tests.report.making import rates, some_findings, the


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


def test_where_the_recording_is_not_at_hand_no_command_opens_a_frame_and_that_is_told():
    (blocks,) = shown(some_findings(worst=[a_frame(7)], inspect=None))
    assert not [block for block in blocks if isinstance(block, Command)]
    assert caption("no command") in [block.text for block in blocks if isinstance(block, Text)]


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
