"""Heat maps: the numbers that a page tells, and the picture of them."""

import cv2
import numpy as np

from roadeval.data.colours import BLACK, GREY, VERMILLION
from roadeval.report.chart import HeatMap
from roadeval.report.page.heat import HeatDrawing
from roadeval.report.shades import palette, shaded


def told(values):
    return HeatDrawing(HeatMap("FP of a", np.array(values), 20.0, [], b"")).values()


def cells(values):
    """The numbers as a script reads them."""
    runs = told(values)["runs"]
    return [each for n, value in zip(runs[::2], runs[1::2], strict=True) for each in [value] * n]


def test_every_cell_is_told_in_tenths_and_what_is_not_known_as_none():
    values = [[0.0, 0.0, 12.34], [np.nan, 0.04, 20.0]]
    assert told(values)["size"] == [3, 2]
    assert cells(values) == [0, 0, 123, -1, 0, 200]


def test_equal_numbers_in_a_row_are_told_once():
    assert told(np.zeros((120, 160)))["runs"] == [120 * 160, 0]


def test_the_picture_goes_from_white_to_the_darkest_shade():
    shades = palette(VERMILLION, BLACK, GREY)
    content = shaded(np.array([[0.0, 10.0], [20.0, np.nan]]), 20.0, shades)
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    seen = [tuple(pixel.tolist()) for pixel in picture.reshape(-1, 3)]
    assert seen == [(255, 255, 255), VERMILLION, BLACK, GREY]
