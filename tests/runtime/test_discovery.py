"""Things found by the folder in which they lie."""

from collections import namedtuple

import pytest

from roadeval.pipeline import paper
from roadeval.runtime.discovery import by_name, found_in

Thing = namedtuple("Thing", "name size")


def test_modules_without_the_name_are_passed_over():
    assert [stage.name for stage in found_in(paper, "STAGE")] == [
        *("post", "shadow", "similarity", "svm")
    ]


def test_two_of_one_name_are_refused():
    assert by_name([Thing("b", 1), Thing("a", 2)]) == {"b": Thing("b", 1), "a": Thing("a", 2)}
    with pytest.raises(ValueError, match="two files define 'a'"):
        by_name([Thing("a", 1), Thing("a", 2)])
