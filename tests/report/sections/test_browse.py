"""A frame on a page: what is said about it, and its pictures by variant."""

import cv2
import numpy as np

from roadeval.data import ERRORS
from roadeval.report.findings import NotableFrame
from roadeval.report.images import LayerImage
from roadeval.report.sections.frames import strip
from tests.report.making import plain_rows, rates

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
    assert [(row.title, [each.name for each in row.pictures]) for row in found.rows] == [
        ("", ["camera", "filtered: errors"]),
        ("filtered", ["filtered: ndi", "filtered: svm"]),
        ("", []),
    ]


def test_outcomes_are_at_most_640_pixels_across_and_layers_300():
    image, mask = np.zeros((4, 700, 3), np.uint8), np.zeros((4, 700), np.uint8)
    outcome, layer = (LayerImage(title, image, ERRORS, mask) for title in ("errors", "svm"))
    frame = NotableFrame(
        7, 0, "filtered", {"filtered": rates(0.4)}, images=[outcome], layers=[[layer]]
    )
    found = strip(frame, ["filtered"])
    assert [[across(each) for each in row.pictures] for row in found.rows] == [[640], [300]]


def across(picture):
    """Pixels across a picture's file."""
    content = np.frombuffer(picture.image.content, np.uint8)
    return cv2.imdecode(content, cv2.IMREAD_COLOR).shape[1]
