"""Frames of which a variant has no mask, as another system's may lack."""

import numpy as np

from roadeval.report.figures.fig2_masks import road_masks
from roadeval.report.figures.figure import ExampleFrame, FigureData
from roadeval.report.images import faded
from roadeval.report.sections.common import example_pictures
from tests.report.making import NO_WINDOWS

IMAGE = np.full((4, 6, 3), 105, np.uint8)
MASK = np.ones((4, 6), np.uint8)
EXAMPLES = [
    ExampleFrame(1, IMAGE, MASK, {"unfiltered": MASK}),
    ExampleFrame(2, IMAGE, MASK, {"unfiltered": MASK, "net": MASK}),
]


def test_every_row_of_the_figure_has_every_variant():
    figure = road_masks(FigureData("street", NO_WINDOWS, EXAMPLES))
    assert len(figure.artists) == 2 * len(["camera", "unfiltered", "net", "truth"])
    assert any("faded: there is no mask" in text.get_text() for text in figure.texts)


def test_the_report_names_the_picture_that_is_missing():
    names = [name for name, _ in example_pictures(EXAMPLES)]
    assert names == [
        *("frame 1", "unfiltered", "net: no mask", "truth"),
        *("frame 2", "unfiltered", "net", "truth"),
    ]


def test_a_faded_image_is_nearly_white():
    assert set(faded(IMAGE).ravel().tolist()) == {225}
