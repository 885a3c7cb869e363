"""The table of equations leads to functions that name them."""

import re
from importlib import import_module

import pytest

from roadeval.pipeline import paper

ROWS = re.findall(r"^\| ([\d-]+) \|.*\| (.*`.*) \|$", paper.__doc__, re.MULTILINE)
CASES = [(numbers, name) for numbers, names in ROWS for name in re.findall(r"`(\w+\.\w+)`", names)]


def equations(text):
    """The numbers of all equations that a text names."""
    numbers = set()
    for first, last in re.findall(r"Eq\. (\d+)(?:-(\d+))?", text):
        numbers |= set(range(int(first), int(last or first) + 1))
    return numbers


def test_the_table_has_all_equations_of_the_pipeline():
    listed = {n for numbers, _ in ROWS for n in equations(f"Eq. {numbers}")}
    # Number 19 is printed nowhere.
    assert listed == set(range(2, 24)) - {19}


@pytest.mark.parametrize(("numbers", "name"), CASES)
def test_a_function_of_the_table_names_its_equation(numbers, name):
    module, function = name.split(".")
    home = import_module(f"{paper.__name__}.{module}")
    assert equations(getattr(home, function).__doc__) & equations(f"Eq. {numbers}")
