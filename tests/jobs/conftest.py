"""Replays without figures, which take most of a small run's time."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from functools import partial
from unittest import mock

import pytest

from roadeval.report import figures as drawn

Figures = Callable[[], AbstractContextManager[object]]
"""Within ``with figures():`` replays draw them."""


@pytest.fixture(scope="module", autouse=True)
def figures() -> Iterator[Figures]:
    drawing = partial(mock.patch.object, drawn, "write_figures", drawn.write_figures)
    with mock.patch.object(drawn, "write_figures", return_value=[]):
        yield drawing
