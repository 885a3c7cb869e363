"""A decision for every colour: the margins' where they can tell, else the definition's."""

import numpy as np
import pytest

from roadeval.kernels import KERNELS
from roadeval.pipeline.colour_table import FEW, LEVELS, sums_of_products, sums_of_terms, table_of
from tests.pipeline.images import noise

GREEN, BLUE = np.indices((256, 256))


def margin(red):
    """Positive inside a ball around a colour, and nowhere 0."""
    away = (red - 90) ** 2 + (GREEN - 140.0) ** 2 + (BLUE - 120.0) ** 2
    return 60.0**2 - 0.5 - away


def decide(colours):
    r, g, b = colours.T.astype(np.int64)
    return (r - 90) ** 2 + (g - 140) ** 2 + (b - 120) ** 2 < 60**2


def planes(colours):
    """``(n, 3)`` colours as an image of one row."""
    return tuple(np.ascontiguousarray(colours[None, :, c]) for c in range(3))


def every_colour(red):
    g, b = np.indices((256, 256), np.uint8).reshape(2, -1)
    return np.stack([np.full_like(g, red), g, b], axis=1)


def test_every_colour_is_decided_as_by_the_definition():
    asked = []
    table = table_of((margin, 20.0), lambda c: asked.append(len(c)) or decide(c))
    for red in (0, 29, 30, 31, 90, 147, 150, 255):
        colours = every_colour(red)
        np.testing.assert_array_equal(
            KERNELS.look_up_colours(planes(colours), table)[0], decide(colours)
        )
    assert 0 < sum(asked) < FEW


def test_what_is_certain_is_not_asked_for():
    def fail(_colours):
        raise AssertionError

    colours = noise(1, 4000)[0]
    found = KERNELS.look_up_colours(planes(colours), table_of((margin, 0.0), fail))
    np.testing.assert_array_equal(found[0], decide(colours))
    assert 0 < found.mean() < 1


def test_a_machine_that_has_learnt_nothing_calls_nothing_road():
    table = table_of((lambda red: np.zeros((256, 256)), 1.0), decide)
    assert not KERNELS.look_up_colours(planes(noise(1, 4000)[0]), table).any()


RNG = np.random.default_rng(0)
CENTRES = RNG.uniform(0, 255, (7, 3))
WEIGHTS = RNG.normal(0, 3, 7)


def bells(width):
    """Gaussian factors of a width in grey levels."""

    def factor(channel, levels):
        return np.exp(-(((levels[:, None] - CENTRES[:, channel]) / width) ** 2))

    return factor


@pytest.mark.parametrize("width", [3000.0, 80.0, 20.0, 5.0, 0.3])
def test_sums_of_products_stay_within_their_bound(width):
    margins, error = sums_of_products(WEIGHTS, bells(width), 0.25, rounding=1e-15)
    assert error < 1e-5
    r, g, b = (bells(width)(channel, LEVELS) for channel in range(3))
    for red in (0, 17, 255):
        exact = np.einsum("i,i,gi,bi->gb", WEIGHTS, r[red], g, b) + 0.25
        assert np.abs(margins(red) - exact).max() <= error


def test_sums_of_terms_are_sums():
    terms = RNG.normal(0, 100, (3, 256))
    margins, error = sums_of_terms(terms, -3.0)
    for red in range(256):
        exact = terms[0, red] + terms[1][:, None] + terms[2][None, :] - 3.0
        assert np.abs(margins(red) - exact).max() <= error < 1e-10
