"""Paths as callers give them."""

from pathlib import Path

import pytest

from roadeval.runtime.paths import listed


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("out.rrd", ["out.rrd"]),
        (Path("out.rrd"), [Path("out.rrd")]),
        (("a.rrd", Path("b.rrd")), ["a.rrd", Path("b.rrd")]),
        ([], []),
    ],
)
def test_one_path_is_a_list_of_one(given, expected):
    assert listed(given) == expected
