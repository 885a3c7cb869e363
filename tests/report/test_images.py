"""Layers as pictures: their description alone gives their colours."""

import cv2
import numpy as np
import pytest

from roadeval.data import ERRORS, LayerKind, LayerSpec
from roadeval.data.colours import MOST_ERRORS, NEVER_LABELLED, VERMILLION
from roadeval.report.images import DARKEN, LayerImage, heat_map, jpeg, paint

GREY = np.full((2, 4, 3), 100, np.uint8)


def test_a_class_has_its_colour_over_the_darkened_image_and_a_clear_one_none():
    labels = np.array([[0, 1, 2, 3], [4, 0, 0, 0]], np.uint8)
    colours = paint(LayerImage("", GREY, ERRORS, labels))
    assert colours[0, 0].tolist() == [100 * DARKEN] * 3
    red, green, blue, alpha = ERRORS.classes[2].rgba
    over = [np.rint(100 * DARKEN * (1 - alpha / 255) + c * alpha / 255) for c in (red, green, blue)]
    assert colours[0, 2].tolist() == over


def test_a_map_of_numbers_spans_its_range_and_is_clipped_to_it():
    spec = LayerSpec("ndi", LayerKind.SCALAR, "NDI", value_range=(-1.0, 1.0))
    colours = paint(LayerImage("", GREY, spec, np.array([[-9.0, -1.0, 1.0, 9.0]], np.float32)))
    low, _, high, _ = colours[0].tolist()
    assert colours[0].tolist() == [low, low, high, high]
    assert sum(high) > sum(low)


@pytest.mark.parametrize(("width", "wanted"), [(3, (3, 2)), (400, (4, 2))])
def test_a_picture_is_brought_down_but_never_up(width, wanted):
    decoded = cv2.imdecode(np.frombuffer(jpeg(LayerImage("", GREY), width).content, np.uint8), 1)
    assert (decoded.shape[1], decoded.shape[0]) == wanted


def test_a_heat_map_goes_from_white_to_the_darkest_shade():
    made = heat_map(np.array([[0.0, 0.2], [np.nan, 0.1]]), 0.2, VERMILLION)
    picture = cv2.imdecode(np.frombuffer(made.content, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    side = len(picture) // 2
    inner = picture[side // 2 :: side, side // 2 :: side].reshape(-1, 3)
    white, dark, unknown, middle = map(tuple, inner.tolist())
    assert (white, dark, unknown) == ((255, 255, 255), MOST_ERRORS, NEVER_LABELLED)
    assert np.allclose(middle, VERMILLION, atol=2)
