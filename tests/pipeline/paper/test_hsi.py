import numpy as np
import pytest

from roadeval.pipeline.paper import shadow as colour
from tests.pipeline.images import noise


@pytest.mark.parametrize(
    ("rgb", "h", "s", "v"),
    [
        ((255, 0, 0), 0, 1, 1 / 3),
        ((255, 255, 0), 60, 1, 2 / 3),
        ((0, 255, 0), 120, 1, 1 / 3),
        ((0, 255, 255), 180, 1, 2 / 3),
        ((0, 0, 255), 240, 1, 1 / 3),
        ((255, 0, 255), 300, 1, 2 / 3),
        ((0, 0, 0), 0, 0, 0),
        ((90, 90, 90), 0, 0, 90 / 255),
        ((255, 255, 255), 0, 0, 1),
        ((200, 100, 0), 30, 1, 100 / 255),
        ((100, 50, 150), 270, 0.5, 100 / 255),
    ],
)
def test_hue_saturation_and_value_by_hand(rgb, h, s, v):
    pixel = np.array(rgb, np.uint8)
    assert colour.hue(pixel) == pytest.approx(h, abs=1e-9)
    assert colour.saturation(pixel) == pytest.approx(s, abs=1e-15)
    assert colour.value(pixel) == pytest.approx(v, abs=1e-15)


def test_hue_is_the_angle_about_the_grey_axis():
    rgb = noise(200, 200)
    r, g, b = np.moveaxis(rgb.astype(float), -1, 0)
    angle = np.degrees(np.arctan2(np.sqrt(3) * (g - b), 2 * r - g - b)) % 360
    apart = np.abs(colour.hue(rgb) - angle)
    assert np.minimum(apart, 360 - apart).max() < 1e-6


def test_conversion_inverts_on_every_seventh_level_and_on_random_colours():
    levels = np.append(np.arange(0, 256, 7), 255).astype(np.uint8)
    lattice = np.stack(np.meshgrid(levels, levels, levels), axis=-1)
    for rgb in (lattice, noise(300, 300)):
        back = colour.hsv_to_rgb(colour.hue(rgb), colour.saturation(rgb), colour.value(rgb))
        np.testing.assert_array_equal(back, rgb)


def test_colours_outside_the_cube_are_clipped():
    white_bright_red = colour.hsv_to_rgb(np.array(0.0), np.array(1.0), np.array(1.0))
    assert white_bright_red.tolist() == [255, 0, 0]
