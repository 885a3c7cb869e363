"""What a stage has learnt as named arrays, and back."""

from dataclasses import dataclass

import numpy as np
import pytest

from roadeval.training.model import arrays_of, from_arrays


@dataclass(frozen=True)
class Line:
    slope: np.ndarray
    start: float


@dataclass(frozen=True)
class Lines:
    upper: Line
    count: int
    lower: Line | None = None


LINE = Line(np.array([1.0, 2.0]), 0.5)


def test_parts_have_the_name_of_their_field_before_theirs():
    assert arrays_of(Lines(LINE, 1)).keys() == {"upper/slope", "upper/start", "count"}
    both = arrays_of(Lines(LINE, 2, Line(np.array([3.0]), 7.0)))
    assert both["lower/slope"].tolist() == [3]
    assert both["lower/start"] == 7


@pytest.mark.parametrize("lower", [None, Line(np.array([3.0]), 7.0)])
def test_they_come_back_as_they_were(lower):
    found = from_arrays(Lines, arrays_of(Lines(LINE, 2, lower)))
    np.testing.assert_array_equal(found.upper.slope, LINE.slope)
    assert (found.upper.start, found.count, type(found.count)) == (0.5, 2, int)
    assert (found.lower is None) == (lower is None)
    if lower:
        assert found.lower.start == 7


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"upper/slope": None}, "slope"),
        ({"upper/slope": None, "upper/start": None}, "slope, start"),
        ({"count": None}, "count"),
        ({"lower/slope": np.zeros(2)}, "start"),
        ({"lower": np.zeros(2)}, "lower"),
        ({"upper/": np.zeros(2)}, ""),
        ({"upper/end": np.zeros(2)}, "end"),
        ({"count/x": np.zeros(2)}, "count/x"),
        ({"middle/slope": np.zeros(2)}, "middle/slope"),
    ],
)
def test_arrays_that_are_missing_or_unknown_are_named(changed, named):
    arrays = arrays_of(Lines(LINE, 1)) | changed
    arrays = {name: array for name, array in arrays.items() if array is not None}
    with pytest.raises(ValueError, match=f"missing or unknown arrays: {named}$"):
        from_arrays(Lines, arrays)
