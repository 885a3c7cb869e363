"""The frames to look at: what is said about each, and how to open it."""

import cv2
import numpy as np

from roadeval.report.blocks import Command, KeepTogether, Text, TwoColumns
from roadeval.report.findings import NotableFrame
from roadeval.report.sections.frames import NO_COMMAND, worst_frames
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
    assert NO_COMMAND in [block.text for block in blocks if isinstance(block, Text)]


def test_where_no_frame_is_the_worst_that_is_told():
    assert the(Text, worst_frames(some_findings())).text == (
        "ERR of filtered is undefined on every frame, so no frame is the worst."
    )


# --- A frame on a page ----------------------------------------------------------------------------


def across(picture):
    """Pixels across a picture's file."""
    content = np.frombuffer(picture.image.content, np.uint8)
    return cv2.imdecode(content, cv2.IMREAD_COLOR).shape[1]
