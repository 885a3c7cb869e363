"""A decision for every colour: the margins' where they can tell, else the definition's."""

import numpy as np

from roadeval.kernels import KERNELS
from roadeval.pipeline.colour_table import FEW, table_of

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
    counts = []
    table = table_of((margin, 20.0), lambda c: counts.append(len(c)) or decide(c))
    for red in (0, 29, 30, 31, 90, 147, 150, 255):
        colours = every_colour(red)
        np.testing.assert_array_equal(
            KERNELS.look_up_colours(planes(colours), table)[0], decide(colours)
        )
    assert 0 < sum(counts) < FEW
