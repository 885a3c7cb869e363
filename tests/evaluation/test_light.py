"""The light of a frame, on images whose light is known."""

import math

import numpy as np
import pytest

from roadeval.evaluation.score import light_of

GREY = 160


def scene(shade=None, share=0.25):
    """A grey ground of which a share, from the left, has the colour of its shadow."""
    image = np.full((120, 160, 3), GREY, np.uint8)
    if shade is not None:
        image[60:, : round(160 * share)] = shade
    return image


def test_an_even_image_has_no_contrast_and_no_shadow():
    light = light_of(scene())
    assert light.luminance == pytest.approx(GREY / 255)
    assert (light.contrast, light.shadow) == (pytest.approx(0, abs=1e-6), 0)
    assert math.isnan(light.sun)


def test_shadow_is_a_share_of_the_lower_half():
    assert light_of(scene((50, 50, 50))).shadow == pytest.approx(0.25)
    above = scene()
    above[:60, :40] = 50
    assert light_of(above).shadow == 0


def test_a_bluer_shadow_tells_the_sun():
    sun, clouds = light_of(scene((40, 46, 55))), light_of(scene((47, 47, 47)))
    assert sun.sun == pytest.approx(math.log(63 / 48))
    assert clouds.sun == pytest.approx(0)


def test_leaves_and_paint_do_not_count():
    image = scene((40, 46, 55))
    image[60:, 80:120] = (60, 140, 60)
    assert light_of(image).sun == pytest.approx(math.log(63 / 48))


def test_a_shadow_of_few_pixels_tells_no_sun():
    image = scene()
    image[110:, :6] = (40, 46, 55)
    assert math.isnan(light_of(image).sun)


def test_the_size_of_the_image_changes_little():
    large = np.repeat(np.repeat(scene((40, 46, 55)), 4, axis=0), 4, axis=1)
    small, great = light_of(scene((40, 46, 55))), light_of(large)
    assert great.shadow == pytest.approx(small.shadow, abs=0.01)
    assert great.sun == pytest.approx(small.sun, abs=0.01)
