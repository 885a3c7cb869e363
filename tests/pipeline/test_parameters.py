"""What learnt parameters must be."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from roadeval.pipeline.stage import check_arrays, check_range


@dataclass
class Learnt:
    points: Any
    weights: Any
    offset: Any


def check(points=((1, 2), (3, 4)), weights=(5, 6), offset=0.5, dtype=np.float64):
    learnt = Learnt(np.array(points, dtype), np.array(weights, dtype), offset)
    check_arrays(learnt, np.float64, points=("n", 2), weights=("n",), offset=())


def test_arrays_of_the_right_shapes_are_accepted():
    check()
    check(points=[[1, 2]], weights=[3], offset=7)


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"points": [[1, 2, 3]]}, r"points has the shape \(1, 3\) instead of \(n, 2\)"),
        ({"points": np.zeros((0, 2)), "weights": []}, r"points has the shape \(0, 2\)"),
        ({"weights": [1, 2, 3]}, r"weights has the shape \(3,\) instead of \(n,\)"),
        ({"offset": [1.0]}, r"offset has the shape \(1,\) instead of \(\)"),
        ({"dtype": np.float32}, "points is of type float32 instead of float64"),
        ({"offset": "1"}, "offset is of type <U1"),
        ({"weights": [1, np.nan]}, r"weights holds a number outside -1e\+15 to 1e\+15"),
        ({"weights": [1, 1e30]}, r"weights holds a number outside -1e\+15 to 1e\+15"),
        ({"offset": np.inf}, "offset holds a number outside"),
    ],
)
def test_what_is_wrong_is_named(wrong, why):
    with pytest.raises(ValueError, match=why):
        check(**wrong)


def test_both_ends_of_a_range_are_in_it():
    check_range("share", [0, 1], 0, 1)
    with pytest.raises(ValueError, match="share holds a number outside 0 to 1"):
        check_range("share", [0, 1.1], 0, 1)
