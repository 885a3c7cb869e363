"""The palette."""

import doctest

from roadeval.data import ERRORS, colours


def test_examples():
    assert doctest.testmod(colours).failed == 0


def test_variants_never_share_a_colour():
    given = (colours.FILTERED, colours.UNFILTERED, colours.BLIND, *colours.EXTRA)
    assert len(set(given)) == len(given)


def test_an_error_map_has_the_documented_colours():
    found = {c.name: colours.hex_of(c.rgba[:3]) for c in ERRORS.classes}
    assert found["TP"] == "#009E73"
    assert found["FP"] == "#D55E00"
    assert found["FN"] == "#CC79A7"
    assert ERRORS.classes[0].rgba == colours.CLEAR
